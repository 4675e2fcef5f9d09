// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "emit/protocol/record/log_csv.hpp"
#include "emit/protocol/record/log_edit.hpp"
#include "emit/protocol/record/pose_pcap.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/commands/log_commands.hpp"
#include "tool/foxglove/foxglove_command.hpp"
#include "tool/streams/frame_log_export.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

struct CutOptions {
  std::filesystem::path log;
  std::optional<double> from_s;
  std::optional<double> to_s;
  std::optional<std::uint64_t> run_id;
  bool only_run = false;
  std::filesystem::path out;
  std::optional<std::filesystem::path> json;
};

struct MergeOptions {
  std::vector<std::string> logs;
  std::filesystem::path out;
  std::optional<std::filesystem::path> json;
};

struct ExportOptions {
  std::filesystem::path log;
  std::filesystem::path out;
  std::string table;  ///< empty: all of them
  std::uint16_t host_port = protocol::kDefaultHostPort;
  std::optional<std::filesystem::path> json;
};

struct ExportFramesOptions {
  std::filesystem::path log;
  std::filesystem::path out;
  std::optional<double> from_s;
  std::optional<double> to_s;
  std::optional<std::uint64_t> run_id;
  std::optional<std::filesystem::path> json;
};

/// Size of the files that a command reads, for its progress; 0 where one cannot be read.
std::uint64_t bytes_of(const std::vector<std::filesystem::path>& files) {
  return std::accumulate(files.begin(), files.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const std::filesystem::path& file) {
                           std::error_code error;
                           const auto bytes = std::filesystem::file_size(file, error);
                           return error ? sum : sum + bytes;
                         });
}

protocol::LogProgress report_to(Progress& progress) {
  return [&progress](std::uint64_t done_bytes) {
    progress.advance_to(done_bytes);
    return !InterruptGuard::interrupted();
  };
}

/// Prints an error of the log library: a wrong choice of run, range or file is one of usage.
int fail_log(const physics::Error& error) {
  return InterruptGuard::interrupted() ? fail(kExitFailure, "interrupted, nothing was written")
                                       : fail_call(error);
}

/// Refuses files that are pose logs, but no MCAP files. `use` says what is done with such a file.
physics::Result<void> require_mcap(const std::filesystem::path& file, std::string_view use) {
  if (!is_pose_csv(file) && !protocol::PosePcapReader::is_capture(file)) return {};
  return physics::make_error(
      physics::ErrorCode::invalid_argument,
      fmt::format("{}: a {}, not an MCAP log; {}", file.string(),
                  is_pose_csv(file) ? "CSV pose log" : "network capture", use));
}

std::string counted(std::uint64_t count, std::string_view what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

std::string text_of(const protocol::LogCutSummary& cut) {
  if (!cut.journal) {
    std::string text = fmt::format("{} host frames of run {}", cut.frames, cut.run_id);
    std::vector<std::string> carried;
    if (cut.carried_weather) carried.emplace_back("the weather");
    if (cut.carried_view) carried.emplace_back("the view");
    if (cut.carried_entities > 0) carried.push_back(counted(cut.carried_entities, "state"));
    if (cut.carried_parts > 0) carried.push_back(counted(cut.carried_parts, "part"));
    if (!carried.empty()) {
      text +=
          fmt::format("; the first one carries {} of frames before it", fmt::join(carried, ", "));
    }
    return text;
  }
  std::string text = fmt::format("{} of run {}", counted(cut.frames, "frame"), cut.run_id);
  if (cut.frames_before > 0 || cut.earlier_runs > 0) {
    text +=
        fmt::format("; kept for the state of the scene: {} before them and {}",
                    counted(cut.frames_before, "frame"), counted(cut.earlier_runs, "earlier run"));
  }
  return text;
}

int run_cut(const CutOptions& command) {
  const auto from_ns = sim_time_ns("--from-s", command.from_s);
  if (!from_ns) return fail_call(from_ns.error());
  const auto until_ns = sim_time_ns("--to-s", command.to_s);
  if (!until_ns) return fail_call(until_ns.error());
  auto mcap = require_mcap(command.log, "emit record and emit make-log write logs to cut");
  if (!mcap) return fail_call(mcap.error());
  protocol::LogCutOptions options;
  options.from_ns = *from_ns;
  options.to_ns = *until_ns;
  options.run_id = command.run_id;
  options.only_run = command.only_run;
  options.software = fmt::format("emit {} log cut", kVersion);
  const InterruptGuard interrupt;
  Progress progress("cut", 2 * bytes_of({command.log}));
  options.progress = report_to(progress);
  const auto cut = protocol::cut_log(command.log, command.out, options);
  progress.finish();
  if (!cut) return fail_log(cut.error());
  if (cut->truncation) warn(*cut->truncation);
  if (cut->other_messages > 0) {
    warn(fmt::format("{}: {} messages of other topics are left out", command.log.string(),
                     cut->other_messages));
  }
  if (cut->left_out_runs > 0) {
    warn(
        fmt::format("left out: {}; frames of a scene with thermal.method = \"cached\" replay to "
                    "other pixels",
                    counted(cut->left_out_runs, "earlier run")));
  }
  fmt::print(text_stream(command.json), "{}: {}\n", command.out.string(), text_of(*cut));
  if (command.json) {
    Json json = Json::object();
    json.set("kind", cut->journal ? "journal" : "poses").set("run_id", cut->run_id);
    json.set("messages", cut->messages).set("frames", cut->frames);
    json.set("frames_before", cut->frames_before).set("earlier_runs", cut->earlier_runs);
    json.set("left_out_runs", cut->left_out_runs).set("other_messages", cut->other_messages);
    json.set("carried_entities", cut->carried_entities);
    json.set("carried_parts", cut->carried_parts);
    json.set("carried_weather", cut->carried_weather).set("carried_view", cut->carried_view);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return kExitOk;
}

void add_cut_options(CommandLine& line, CutOptions& options) {
  line.path("log", options.log, "MCAP log: a journal, or a log with host frames").required();
  line.option("--from-s", options.from_s,
              "First simulation time; default: the begin of the run. A journal keeps the frames "
              "before it and the earlier runs, because the state of the scene comes from them")
      .type_name("S");
  line.option("--to-s", options.to_s, "Last simulation time; default: the end of the run")
      .type_name("S");
  line.option("--run-id", options.run_id,
              "Run to cut, as emit log info lists it; needed where several runs have frames in "
              "the range")
      .type_name("N");
  line.flag("--only-run", options.only_run,
            "Leave earlier runs out of a journal. Frames are the same only with thermal.method = "
            "\"per-frame\": a cached surface remembers earlier runs");
  line.output_file("--out", options.out, "MCAP log to write").required();
  add_json(line, options.json);
}

int run_merge(const MergeOptions& command) {
  const std::vector<std::filesystem::path> inputs(command.logs.begin(), command.logs.end());
  for (const std::filesystem::path& input : inputs) {
    auto mcap = require_mcap(
        input, "send it to a daemon with emit send and merge what that daemon records");
    if (!mcap) return fail_call(mcap.error());
  }
  protocol::LogMergeOptions options;
  options.software = fmt::format("emit {} log merge", kVersion);
  const InterruptGuard interrupt;
  Progress progress("merge", 2 * bytes_of(inputs));
  options.progress = report_to(progress);
  const auto merged = protocol::merge_logs(inputs, command.out, options);
  progress.finish();
  if (!merged) return fail_log(merged.error());
  for (const std::string& note : merged->notes) warn(note);
  fmt::print(text_stream(command.json), "{}: {} messages of {} logs, {} runs with {} frames\n",
             command.out.string(), merged->messages, inputs.size(), merged->runs, merged->frames);
  if (command.json) {
    Json order = Json::array();
    for (const std::filesystem::path& file : merged->order) order.push(file.string());
    Json json = Json::object();
    json.set("messages", merged->messages).set("runs", merged->runs);
    json.set("frames", merged->frames).set("order", std::move(order));
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return kExitOk;
}

void add_merge_options(CommandLine& line, MergeOptions& options) {
  line.option("logs", options.logs, "MCAP logs, in any order")
      .required()
      .type_name("FILE")
      .may_be_file();
  line.output_file("--out", options.out, "MCAP log to write").required();
  add_json(line, options.json);
}

int run_export(const ExportOptions& command) {
  if (is_pose_csv(command.log)) {
    return fail(kExitUsage, command.log.string() + ": is a CSV file already");
  }
  if (command.table.empty() && is_pose_csv(command.out)) {
    return fail(kExitUsage,
                fmt::format("--out: {}: names one file; --table says which of them: {}",
                            command.out.string(), fmt::join(protocol::kLogTableNames, ", ")));
  }
  protocol::LogCsvOptions options;
  options.host_port = command.host_port;
  const auto& names = protocol::kLogTableNames;
  const auto name = std::ranges::find(names, command.table);
  if (name != names.end()) options.table = static_cast<protocol::LogTable>(name - names.begin());
  const InterruptGuard interrupt;
  Progress progress("export", bytes_of({command.log}));
  options.progress = report_to(progress);
  const auto tables = protocol::export_log_csv(command.log, command.out, options);
  progress.finish();
  if (!tables) return fail_log(tables.error());
  if (tables->notes) warn(*tables->notes);
  Json rows = Json::object();
  for (std::size_t i = 0; i < protocol::kLogTables; ++i) {
    if (options.table && *options.table != static_cast<protocol::LogTable>(i)) continue;
    const auto file = options.table ? command.out : command.out / fmt::format("{}.csv", names[i]);
    fmt::print(text_stream(command.json), "{}: {} rows\n", file.string(), tables->rows[i]);
    rows.set(names[i], tables->rows[i]);
  }
  if (command.json) {
    Json json = Json::object();
    json.set("rows", std::move(rows));
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return kExitOk;
}

void add_export_options(CommandLine& line, ExportOptions& options) {
  line.path("log", options.log, "MCAP log, or a pcap/pcapng capture of a host's datagrams")
      .required();
  line.output_file_or_folder(
          "--out", options.out, [&options] { return !options.table.empty(); },
          "Folder for NAME.csv of every table; with --table the file of that "
          "one")
      .required();
  line.option("--table", options.table, "Write this table alone")
      .type_name("NAME")
      .one_of({protocol::kLogTableNames.begin(), protocol::kLogTableNames.end()});
  line.option("--host-port", options.host_port, "Capture: UDP port the host sent to")
      .type_name("PORT")
      .in_range(1, 65535)
      .show_default();
  add_json(line, options.json);
}

int run_export_frames(const ExportFramesOptions& command) {
  const auto from_ns = sim_time_ns("--from-s", command.from_s);
  if (!from_ns) return fail_call(from_ns.error());
  const auto until_ns = sim_time_ns("--to-s", command.to_s);
  if (!until_ns) return fail_call(until_ns.error());
  auto mcap = require_mcap(command.log, "emit record --with-frames writes logs with images");
  if (!mcap) return fail_call(mcap.error());
  if (auto made = make_directory(command.out); !made) return fail(made.error());
  FrameExportOptions options;
  options.from_ns = *from_ns;
  options.to_ns = *until_ns;
  options.run_id = command.run_id;
  const InterruptGuard interrupt;
  options.progress = [](std::uint64_t) { return !InterruptGuard::interrupted(); };
  const auto images = export_log_frames(command.log, command.out, options);
  if (!images) return fail_call(images.error());
  if (images->truncation) warn(*images->truncation);
  fmt::print(text_stream(command.json), "{}: {} images, {} compared with the journal, {} differ\n",
             command.out.string(), images->images, images->compared, images->differ);
  if (command.json) {
    Json json = Json::object();
    json.set("images", images->images).set("compared", images->compared);
    json.set("differ", images->differ);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  if (images->differ > 0) {
    return fail(kExitFailure, fmt::format("{} images differ from the journal, the first is that of "
                                          "frame {}",
                                          images->differ, images->first_differing));
  }
  return kExitOk;
}

void add_export_frames_options(CommandLine& line, ExportFramesOptions& options) {
  line.path("log", options.log, "MCAP log with images (emit record --with-frames)").required();
  line.output_folder("--out", options.out, "Folder for frame_NNNNNN.exr").required();
  add_time_range(line, options.from_s, options.to_s);
  line.option("--run-id", options.run_id,
              "Run to export; needed where several runs have images in the range")
      .type_name("N");
  add_json(line, options.json);
}

}  // namespace

void add_log(CommandLine& tool) {
  CommandLine log = tool.group({.name = "log",
                                .text = "Describe, cut, merge and export recorded logs",
                                .example = "emit log info run.mcap"});
  log.footer(
      "Example: emit log info run.mcap\n"
      "         emit log cut run.mcap --from-s 10 --to-s 12.5 --out cut.mcap\n"
      "         emit log merge journal.*.mcap journal.mcap --out all.mcap\n"
      "         emit log export csv run.mcap --out tables\n"
      "         emit log export exr run.mcap --out frames\n"
      "         emit log export foxglove run.mcap --out run.foxglove.mcap");
  add_log_info(log);
  log.command<CutOptions>(
      {.name = "cut",
       .text = "Cut a range of simulation time out of a log, so that it replays to the same frames",
       .example = "emit log cut run.mcap --from-s 10 --to-s 12.5 --out cut.mcap"},
      add_cut_options, run_cut);
  log.command<MergeOptions>(
      {.name = "merge",
       .text = "Join logs by time, e.g. the journals that restarts of the daemon left",
       .example = "emit log merge journal.20261124T093000Z.mcap journal.mcap --out all.mcap"},
      add_merge_options, run_merge);
  CommandLine tables = log.group({.name = "export",
                                  .text = "Write the contents of a log in another format",
                                  .example = "emit log export csv run.mcap --out tables"});
  tables.command<ExportOptions>(
      {.name = "csv",
       .text = "Write poses, entities, frames with flags, weather and events as CSV tables",
       .example = "emit log export csv run.mcap --table frames --out frames.csv"},
      add_export_options, run_export);
  tables.command<ExportFramesOptions>(
      {.name = "exr",
       .text = "Write the images of a log as OpenEXR, and compare them with its journal",
       .example = "emit log export exr run.mcap --out frames"},
      add_export_frames_options, run_export_frames);
  add_log_export_foxglove(tables);
}

}  // namespace emit::tool
