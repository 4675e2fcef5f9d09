// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <unistd.h>

#include <memory>
#include <optional>

#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/replay/replay_console.hpp"
#include "tool/streams/journal_replay.hpp"
#include "tool/streams/step_input.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct ReplayOptions {
  std::filesystem::path log;
  ScenarioChoice input;
  std::optional<std::filesystem::path> out;
  std::string png_of = "apparent";
  std::string speed = "max";
  bool step = false;
  std::string console;
  std::optional<double> from_s;
  std::optional<double> to_s;
  std::optional<std::uint64_t> run_id;
  std::uint64_t loop = 1;
  bool anyway = false;
  int gpu_index = -1;
  std::optional<std::filesystem::path> json;
};

physics::Result<JournalReplayOptions> journal_options(const ReplayOptions& command) {
  const auto speed = parse_speed(command.speed);
  if (!speed) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "--speed: a positive number or max");
  }
  const auto from_ns = sim_time_ns("--from-s", command.from_s);
  if (!from_ns) return tl::unexpected(from_ns.error());
  const auto until_ns = sim_time_ns("--to-s", command.to_s);
  if (!until_ns) return tl::unexpected(until_ns.error());
  JournalReplayOptions options;
  options.log = command.log;
  // The console paces its replay itself.
  options.speed = command.console.empty() ? *speed : 0.0;
  options.from_ns = *from_ns;
  options.to_ns = *until_ns;
  options.run_id = command.run_id;
  options.passes = command.loop;
  options.anyway = command.anyway;
  options.gpu_index = command.gpu_index;
  options.temperature = command.out.has_value();
  return options;
}

/// Writes frames as files.
class FrameFolder {
 public:
  FrameFolder(std::filesystem::path folder, const scene::ScenarioDesc& scenario,
              const std::string& png_of)
      : folder_(std::move(folder)),
        band_(scenario.bands.empty() ? scene::SpectralBand{} : scenario.bands.front()),
        style_{scenario.display.min_k, scenario.display.max_k, png_quantity(png_of)} {
    if (physics::validate(scene::spectral_band(band_)))
      apparent_.emplace(scene::spectral_band(band_));
  }

  [[nodiscard]] physics::Result<void> write(const server::ReplayedFrame& frame) const {
    if (frame.view == nullptr) return {};
    constexpr std::size_t kPlane = 0;  // bands are in the order of the channels
    FramePlanes planes;
    planes.width_px = frame.view->width_px;
    planes.height_px = frame.view->height_px;
    planes.radiance_w_m2_sr = frame.view->radiance_w_m2_sr[kPlane];
    planes.temperature_k = frame.view->temperature_k;
    planes.depth_m = frame.view->depth_m;
    planes.object_id = frame.view->object_id;
    planes.apparent = apparent_ ? &*apparent_ : nullptr;
    planes.metadata = {frame.sim_time_ns,
                       frame.frame_number,
                       frame.view->sensor_pose,
                       band_.name,
                       band_.lo_um,
                       band_.hi_um,
                       "W m-2 sr-1",
                       scene::spectral_band(band_).response,
                       frame.view->fov_h_rad};
    return write_frame_files(folder_, planes, style_);
  }

 private:
  std::filesystem::path folder_;
  scene::SpectralBand band_;
  PngStyle style_;
  std::optional<ApparentTemperature> apparent_;
};

double seconds(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

std::string text_of(const JournalReplaySummary& summary, const ReplayOptions& command) {
  std::string text =
      fmt::format("{} frames replayed ({} rendered)", summary.frames, summary.rendered);
  if (command.loop != 1) text += fmt::format(" in {} passes", summary.passes);
  text +=
      fmt::format(" in {:.2f} s, {} differ from the recording: {}\n", summary.play_s,
                  summary.mismatches, summary.mismatches == 0 ? "bit-identical" : "NOT identical");
  if (summary.frames_before > 0) {
    text +=
        fmt::format("{} frames before the range rendered for the state of the scene, {} differ\n",
                    summary.frames_before, summary.mismatches_before);
  }
  // A frame that is due while the one before it is rendered comes late, but is not left out.
  constexpr std::int64_t kNotableNs = 5'000'000;
  if (summary.latest_ns > kNotableNs) {
    text += fmt::format("behind the pace by up to {:.3f} s\n", seconds(summary.latest_ns));
  }
  return text;
}

Json json_of(const JournalReplaySummary& summary) {
  Json json = Json::object();
  json.set("device", summary.device).set("recorded_device", summary.recorded.device);
  json.set("recorded_software", summary.recorded.software);
  json.set("recorded_scenario", summary.recorded.scenario_name);
  json.set("recorded_scenario_sha256", summary.recorded.scenario_sha256);
  Json differences = Json::array();
  for (const server::SetupDifference& one : summary.differences) differences.push(one.text());
  json.set("differences", std::move(differences));
  json.set("frames", summary.frames).set("rendered", summary.rendered);
  json.set("mismatches", summary.mismatches).set("passes", summary.passes);
  json.set("frames_before", summary.frames_before);
  json.set("mismatches_before", summary.mismatches_before);
  json.set("seconds", summary.play_s).set("behind_s", seconds(summary.latest_ns));
  json.set("bit_identical", summary.mismatches == 0 && summary.mismatches_before == 0);
  return json;
}

int run(const ReplayOptions& command) {
  const auto options = journal_options(command);
  if (!options) return fail_call(options.error());
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  std::optional<FrameFolder> folder;
  if (command.out) {
    if (auto made = make_directory(*command.out); !made) return fail(made.error());
    folder.emplace(*command.out, *scenario, command.png_of);
  }

  const InterruptGuard interrupt;
  StepInput input(STDIN_FILENO);
  ReplayHooks hooks;
  if (command.step) {
    hooks.order = [&](std::uint64_t) {
      return input.wait_for_line() ? ReplayOrder::show : ReplayOrder::end;
    };
  }
  hooks.on_frame = [&](const server::ReplayedFrame& frame,
                       std::uint64_t pass) -> physics::Result<void> {
    if (!frame.matches) {
      warn(fmt::format("frame {}: CRC {:08x}, recorded {:08x}", frame.frame_number, frame.crc32c,
                       frame.journal_crc32c));
    }
    if (command.step) {
      std::FILE* out = text_stream(command.json);
      fmt::print(out, "frame {} of run {} at {:.9f} s, CRC {:08x}{}\n", frame.frame_number,
                 frame.run_id, seconds(frame.sim_time_ns), frame.crc32c,
                 frame.repeated ? ", repeated" : "");
      std::fflush(out);
    }
    // Later passes give the same files.
    return folder && pass == 1 ? folder->write(frame) : physics::Result<void>();
  };
  SystemReplayClock clock;
  const ReplayBench bench = renderer_bench(*scenario, *options, clock);
  std::unique_ptr<ReplayConsole> console;
  if (!command.console.empty()) {
    auto made = ReplayConsole::create(
        bench, command.log, {command.console, *parse_speed(command.speed), scenario->name});
    if (!made) return fail_call(made.error());
    console = std::move(*made);
    console->attach(hooks);
  }
  const auto summary = replay_journal(bench, *options, hooks);
  if (!summary) return fail_call(summary.error());

  fmt::print(text_stream(command.json), "{}", text_of(*summary, command));
  if (command.json) {
    if (auto done = write_json(*command.json, json_of(*summary)); !done) return fail(done.error());
  }
  if (summary->mismatches > 0) {
    return fail(kExitFailure,
                fmt::format("{} of {} frames differ, the first is frame {}", summary->mismatches,
                            summary->frames, summary->first_mismatch));
  }
  if (summary->mismatches_before > 0) {
    return fail(kExitFailure, fmt::format("{} of {} frames before the range differ",
                                          summary->mismatches_before, summary->frames_before));
  }
  return kExitOk;
}

void add_options(CommandLine& line, ReplayOptions& options) {
  line.path("log", options.log, "MCAP log of emit record, or of the daemon's journal").required();
  add_scenario(line, options.input, "--scenario");
  line.output_folder("--out", options.out, "Folder for frame_NNNNNN.exr and .png");
  add_png_of(line, options.png_of, true);
  Option speed = line.option("--speed", options.speed,
                             "Multiple of the recorded pace (1: real time), or max: as fast as it "
                             "goes. Frames that come late are not left out")
                     .type_name("X")
                     .show_default();
  Option step = line.flag("--step", options.step,
                          "Show one frame for each line of standard input, e.g. Enter; the line q "
                          "or the end of the input ends the replay")
                    .excludes(speed);
  Option console =
      line.option("--console", options.console,
                  "Serve the operator's console at this address:port of this host, e.g. "
                  "127.0.0.1:7003: a page with a bar of the recording's time that holds, steps, "
                  "seeks, loops and paces the replay, until it is interrupted")
          .type_name("ADDRESS")
          .excludes(step);
  line.option("--from-s", options.from_s,
              "First simulation time shown; default: the begin. What comes before it is rendered "
              "without being shown, so that the frames are those of a whole replay")
      .type_name("S");
  line.option("--to-s", options.to_s, "Last simulation time shown; default: the end")
      .type_name("S");
  line.option("--run-id", options.run_id,
              "Show this run alone, as emit log info lists it; needed where several runs have "
              "frames in the range")
      .type_name("N");
  line.option("--loop", options.loop,
              "Play so many times, each from the same state; 0: until interrupted. Files are "
              "written once")
      .type_name("N")
      .show_default()
      .excludes(console);
  line.flag("--anyway", options.anyway,
            "Replay although scenario or channels are not those of the recording");
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_replay(CommandLine& tool) {
  tool.command<ReplayOptions>(
      {.name = "replay",
       .text =
           "Apply a recorded journal and check every frame bit for bit; exits 1 on a difference",
       .example = "emit replay run.mcap --scenario airfield --out frames"},
      add_options, run);
}

}  // namespace emit::tool
