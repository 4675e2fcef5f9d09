// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "emit/protocol/record/log.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct MakeLogOptions {
  ScenarioChoice input;
  double rate_hz = 200.0;
  std::optional<double> start_s;  ///< absent: first node of the sensor trajectory
  double duration_s = 20.0;
  std::filesystem::path out;
};

int run(const MakeLogOptions& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  if (auto fits = check_entities_fit(*scenario); !fits) return fail_config(fits.error());
  if (scenario->sensor.trajectory.empty()) {
    return fail(kExitConfig,
                fmt::format("{}: the sensor has no trajectory", scenario->file.string()));
  }
  const std::int64_t start_ns =
      command.start_s ? std::llround(*command.start_s * 1e9) : trajectory_start_ns(*scenario);
  if (start_ns < 0) return fail(kExitUsage, "--start-s: a log starts at or after the epoch");

  protocol::LogWriterOptions options;
  options.software = fmt::format("emit {} make-log", kVersion);
  auto writer = protocol::LogWriter::create(command.out, options);
  if (!writer) return fail(writer.error());
  const auto count =
      static_cast<std::uint64_t>(std::floor(command.duration_s * command.rate_hz + 1e-9)) + 1;
  Progress progress("poses", count);
  const auto frame = std::make_unique<protocol::HostFrameData>();
  for (std::uint64_t i = 0; i < count; ++i) {
    make_host_frame(*scenario, start_ns, command.rate_hz, i, *frame);
    if (auto done = writer->write_host(*frame, frame->sim_time_ns); !done)
      return fail(done.error());
    progress.advance_to(i + 1);
  }
  progress.finish();
  if (auto done = writer->close(); !done) return fail(done.error());
  fmt::print("{}: {} poses, {:g} Hz, sim time {:.3f} to {:.3f} s, {} entities\n",
             command.out.string(), count, command.rate_hz, 1e-9 * static_cast<double>(start_ns),
             1e-9 * static_cast<double>(frame->sim_time_ns), frame->entity_count);
  return kExitOk;
}

void add_options(CommandLine& line, MakeLogOptions& options) {
  add_scenario(line, options.input, "scenario");
  line.option("--rate-hz", options.rate_hz, "Poses a second").positive().show_default();
  line.option("--start-s", options.start_s,
              "Simulated time of the first pose; default: the sensor trajectory's first node");
  line.seconds("--duration-s", options.duration_s, "Length").positive().show_default();
  line.output_file("--out", options.out, "MCAP log to write").required();
}

}  // namespace

void add_make_log(CommandLine& tool) {
  tool.command<MakeLogOptions>(
      {.name = "make-log",
       .text = "Make a host log from a scenario's own trajectories",
       .example = "emit make-log airfield --rate-hz 200 --duration-s 20 --out airfield.mcap"},
      add_options, run);
}

}  // namespace emit::tool
