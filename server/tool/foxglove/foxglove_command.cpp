// SPDX-License-Identifier: Apache-2.0
#include "tool/foxglove/foxglove_command.hpp"

#include <fmt/format.h>

#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/foxglove/foxglove_export.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

struct ExportFoxgloveOptions {
  std::filesystem::path log;
  std::filesystem::path out;
  std::string images = "both";
  std::optional<double> from_s;
  std::optional<double> to_s;
  std::optional<std::uint64_t> run_id;
  std::optional<std::filesystem::path> json;
};

int run_export(const ExportFoxgloveOptions& command) {
  const auto from_ns = sim_time_ns("--from-s", command.from_s);
  if (!from_ns) return fail_call(from_ns.error());
  const auto until_ns = sim_time_ns("--to-s", command.to_s);
  if (!until_ns) return fail_call(until_ns.error());
  FoxgloveOptions options;
  options.from_ns = *from_ns;
  options.to_ns = *until_ns;
  options.run_id = command.run_id;
  options.images.values = command.images == "both" || command.images == "values";
  options.images.preview = command.images == "both" || command.images == "preview";
  options.software = fmt::format("emit {} log export foxglove", kVersion);
  const InterruptGuard interrupt;
  Progress progress("export", kShareParts);
  options.progress = share_of(progress);
  const auto done = export_foxglove(command.log, command.out, options);
  progress.finish();
  if (!done) {
    return InterruptGuard::interrupted() ? fail(kExitFailure, "interrupted, nothing was written")
                                         : fail_call(done.error());
  }
  for (const std::string& note : done->notes) warn(note);
  Json topics = Json::object();
  for (const FoxgloveTopic& topic : done->topics) {
    fmt::print(text_stream(command.json), "{}: {} {}\n", topic.name, topic.messages, topic.message);
    Json one = Json::object();
    one.set("schema", topic.message).set("messages", topic.messages);
    topics.set(topic.name, std::move(one));
  }
  if (command.json) {
    Json json = Json::object();
    json.set("run_id", done->run_id).set("epoch_utc_ns", done->epoch_utc_ns);
    json.set("topics", std::move(topics));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, ExportFoxgloveOptions& options) {
  line.path("log", options.log, "MCAP log: a journal, with or without images, or host frames")
      .required();
  line.output_file("--out", options.out, "MCAP file to write").required();
  line.option("--images", options.images,
              "Images to write: their values (32FC1), a preview in colours (rgb8), both or none")
      .type_name("WHICH")
      .one_of({"both", "values", "preview", "none"})
      .show_default();
  add_time_range(line, options.from_s, options.to_s);
  line.option("--run-id", options.run_id,
              "Run to export; needed where several runs have frames in the range")
      .type_name("N");
  add_json(line, options.json);
}

}  // namespace

void add_log_export_foxglove(CommandLine& exports) {
  exports.command<ExportFoxgloveOptions>(
      {.name = "foxglove",
       .text = "Write a run as an MCAP file with the messages that Foxglove and rerun show",
       .example = "emit log export foxglove run.mcap --out run.foxglove.mcap"},
      add_options, run_export);
}

}  // namespace emit::tool
