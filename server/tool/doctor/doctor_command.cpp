// SPDX-License-Identifier: Apache-2.0
#include "tool/doctor/doctor_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>

#include "emit/config/load.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/doctor/findings.hpp"
#include "tool/support/console.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {
namespace {

struct DoctorOptions {
  DoctorNeeds needs;
  std::optional<std::filesystem::path> json;
};

const char* name_of(Severity severity) {
  switch (severity) {
    case Severity::pass:
      return "pass";
    case Severity::warn:
      return "warn";
    case Severity::fail:
      break;
  }
  return "fail";
}

int run(const DoctorOptions& command) {
  MachineFacts facts = look_at_machine("/");
  facts.graphics = renderer::graphics_devices();
  for (const std::filesystem::path& folder : config::data_directories()) {
    std::error_code ignored;
    if (std::filesystem::is_directory(folder / "scenarios", ignored)) facts.data.push_back(folder);
  }
  const std::vector<Finding> findings = findings_of(facts, command.needs);
  const auto count = [&](Severity severity) {
    return std::ranges::count(findings, severity, &Finding::severity);
  };
  std::FILE* out = text_stream(command.json);
  for (const Finding& each : findings) {
    fmt::print(out, "{:<5} {:<24} {}\n", name_of(each.severity), each.item, each.found);
    if (!each.remedy.empty()) fmt::print(out, "{:<31}-> {}\n", "", each.remedy);
  }
  fmt::print(out, "{} pass, {} warn, {} fail\n", count(Severity::pass), count(Severity::warn),
             count(Severity::fail));
  if (command.json) {
    Json rows = Json::array();
    for (const Finding& each : findings) {
      rows.push(Json::object()
                    .set("severity", name_of(each.severity))
                    .set("item", each.item)
                    .set("found", each.found)
                    .set("remedy", each.remedy));
    }
    Json json = Json::object();
    json.set("real_time", command.needs.real_time)
        .set("frame_mib", command.needs.frame_mib)
        .set("findings", std::move(rows))
        .set("warnings", count(Severity::warn))
        .set("failures", count(Severity::fail));
    if (const auto written = write_json(*command.json, json); !written) {
      return fail(written.error());
    }
  }
  return count(Severity::fail) == 0 ? kExitOk : kExitFailure;
}

void add_options(CommandLine& line, DoctorOptions& options) {
  line.flag("--real-time", options.needs.real_time,
            "Judge for the profile low_latency: limits that it would be refused, and instants that "
            "would be wrong, are failures");
  line.option("--frame-mib", options.needs.frame_mib,
              "Size of a frame, MiB, for the buffers of sockets and shared memory")
      .in_range(1U, 9999U);
  add_json(line, options.json);
}

}  // namespace

void add_doctor(CommandLine& tool) {
  tool.command<DoctorOptions>(
      {.name = "doctor",
       .text = "What this machine lacks for emitd: graphics, data, limits, network, processor, "
               "kernel, clock, each with its remedy. Run it as the user that emitd runs as; it "
               "changes nothing and exits 1 where something fails",
       .example = "emit doctor --real-time"},
      add_options, run);
}

}  // namespace emit::tool
