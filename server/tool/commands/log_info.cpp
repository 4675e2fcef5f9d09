// SPDX-License-Identifier: Apache-2.0
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <set>

#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/log_outline.hpp"
#include "emit/protocol/record/mcap_summary.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/log_commands.hpp"
#include "tool/commands/log_setup.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using protocol::LogOutline;
using protocol::LogSpan;
using protocol::McapSummary;

struct InfoOptions {
  std::filesystem::path log;
  std::uint16_t host_port = protocol::kDefaultHostPort;
  std::optional<std::filesystem::path> json;
};

/// Everything that is known about an MCAP file.
struct FileInfo {
  std::string kind;   ///< of JSON
  std::string title;  ///< for people
  LogOutline outline;
  McapSummary summary;
  std::string end;       ///< of JSON: how the file ends
  std::string end_text;  ///< for people
  std::set<std::string> compressions;
  std::uint64_t chunks = 0;
  bool index_only = false;  ///< the chunks are compressed: counts come from the index
};

std::string sim_text(std::int64_t time_ns) {
  return fmt::format("{:.6f}", 1e-9 * static_cast<double>(time_ns));
}

/// Log times are wall instants or, in a log that was made, simulation times. Only the former lie
/// decades behind the epoch.
std::string log_time_text(std::int64_t time_ns) {
  constexpr std::int64_t kYear1990Ns = 631'152'000'000'000'000;
  constexpr std::int64_t kNsPerS = 1'000'000'000;
  if (time_ns < kYear1990Ns) return sim_text(time_ns) + " s";
  const std::time_t whole_s = time_ns / kNsPerS;
  std::tm parts{};
  ::gmtime_r(&whole_s, &parts);
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:06} TAI", parts, time_ns % kNsPerS / 1000);
}

void set_span(Json& json, const char* name, const std::optional<LogSpan>& span) {
  json.set(fmt::format("first_{}_ns", name), span ? Json(span->first_ns) : Json());
  json.set(fmt::format("last_{}_ns", name), span ? Json(span->last_ns) : Json());
}

/// Finds out how the file ends, and what the index adds.
physics::Result<void> judge_end(const std::filesystem::path& file, FileInfo& info) {
  auto summary = protocol::read_mcap_summary(file);
  if (!summary) return tl::unexpected(summary.error());
  info.summary = std::move(*summary);
  if (info.outline.truncation) {
    info.end = "cut_off";
    info.end_text = "cut off by a crash, or not closed yet: " + *info.outline.truncation;
  } else if (info.summary.state == McapSummary::State::complete) {
    info.end = "complete";
    info.end_text = "complete, with index and footer";
  } else {
    info.end = info.summary.state == McapSummary::State::none ? "no_index" : "damaged_index";
    info.end_text = "the index is not usable: " + info.summary.problem;
  }
  for (const auto& [name, count] : info.summary.chunks_of_compression) {
    info.compressions.insert(name);
  }
  info.chunks = info.outline.facts.chunks;
  const auto& damage = info.outline.damage;
  info.index_only = damage && damage->code == physics::ErrorCode::unsupported &&
                    info.summary.state == McapSummary::State::complete;
  if (info.index_only) {
    info.chunks = 0;
    for (const auto& [name, count] : info.summary.chunks_of_compression) info.chunks += count;
  }
  return {};
}

/// Takes topics and schemas from the index of a file whose chunks do not read.
void take_index(FileInfo& info) {
  info.outline.topics.clear();
  info.outline.schemas.clear();
  for (const auto& [id, schema] : info.summary.schemas) info.outline.schemas.push_back(schema);
  for (const auto& [id, channel] : info.summary.channels) {
    protocol::LogTopicOutline& topic = info.outline.topics.emplace_back();
    topic.topic = channel.topic;
    topic.encoding = channel.message_encoding;
    const auto schema = info.summary.schemas.find(channel.schema_id);
    if (schema != info.summary.schemas.end()) topic.message = schema->second.name;
    if (!info.summary.statistics) continue;
    const auto& counts = info.summary.statistics->messages_of_channel;
    if (const auto count = counts.find(id); count != counts.end()) topic.messages = count->second;
  }
}

void judge_kind(FileInfo& info) {
  const auto holds = [&](std::string_view name) {
    return std::ranges::any_of(info.outline.topics, [&](const protocol::LogTopicOutline& topic) {
      return topic.topic == name && topic.messages > 0;
    });
  };
  const bool own = std::ranges::any_of(
      info.outline.schemas,
      [](const protocol::McapSchema& schema) { return schema.name.starts_with("emit.v1."); });
  if (own && holds(protocol::kJournalTopic)) {
    info.kind = "journal";
    info.title = "journal of emitd";
  } else if (own && holds(protocol::kHostTopic)) {
    info.kind = "poses";
    info.title = "pose log";
  } else if (own) {
    info.kind = "empty";
    info.title = "log of emitd without a message";
  } else {
    info.kind = "foreign";
    info.title = "MCAP file of other software";
  }
}

std::string compression_text(const FileInfo& info) {
  std::string text;
  for (const std::string& name : info.compressions) {
    text += fmt::format("{}{}", text.empty() ? "" : " and ", name.empty() ? "none" : name);
  }
  return text.empty() ? std::string("none") : text;
}

std::string flags_text(const LogOutline& outline) {
  std::string text;
  for (std::size_t bit = 0; bit < outline.frames_with_flag.size(); ++bit) {
    const std::uint64_t count = outline.frames_with_flag[bit];
    if (count == 0) continue;
    const auto& names = protocol::kFrameFlagNames;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ",
                        bit < names.size() ? std::string(names[bit]) : fmt::format("bit_{}", bit),
                        count);
  }
  return text.empty() ? std::string("none") : text;
}

void print_topics(std::FILE* out, const LogOutline& outline) {
  TextTable table({"topic", "message", "messages", "first log time", "last log time", "first sim s",
                   "last sim s"});
  for (const protocol::LogTopicOutline& topic : outline.topics) {
    const auto& log = topic.log_time;
    const auto& sim = topic.sim_time;
    table.add({topic.topic, topic.message, fmt::format("{}", topic.messages),
               log ? log_time_text(log->first_ns) : "-", log ? log_time_text(log->last_ns) : "-",
               sim ? sim_text(sim->first_ns) : "-", sim ? sim_text(sim->last_ns) : "-"});
  }
  fmt::print(out, "\n{}", table.to_string());
}

void print_run(std::FILE* out, const protocol::LogRunOutline& run) {
  if (run.has_start) {
    fmt::print(out, "\nrun {}, from {}{}\n", run.run_id,
               run.log_time ? log_time_text(run.log_time->first_ns) : "-",
               run.begins_process ? ", the first of a daemon" : "");
    fmt::print(out, "  scenario    {}, SHA-256 {}\n", run.scenario_name, run.scenario_sha256);
    fmt::print(out, "  made by     {} on {}, pacing {}, warmed up for {} s\n", run.software,
               run.device, run.pacing, sim_text(run.first_time_ns));
    fmt::print(out, "  setup       {}\n", setup_text(run));
  } else {
    fmt::print(out, "\nrun without its start: it does not replay\n");
  }
  fmt::print(out, "  entries     {} to {}, {} host frames, {} commands\n", run.first_sequence,
             run.last_sequence, run.host_frames, run.commands);
  if (run.frames == 0) {
    fmt::print(out, "  frames      none\n");
    return;
  }
  fmt::print(out, "  frames      {} ({} rendered), numbers {} to {}, {} s to {} s\n", run.frames,
             run.rendered, run.first_frame, run.last_frame, sim_text(run.sim_time->first_ns),
             sim_text(run.sim_time->last_ns));
}

void print_journal(std::FILE* out, const LogOutline& outline) {
  constexpr std::size_t kMaxRuns = 50;
  for (std::size_t i = 0; i < outline.runs.size() && i < kMaxRuns; ++i) {
    print_run(out, outline.runs[i]);
  }
  if (outline.runs.size() > kMaxRuns) {
    fmt::print(out, "\nand {} more runs, see --json\n", outline.runs.size() - kMaxRuns);
  }
  fmt::print(out, "\nframes      {}, of them {} rendered; flags: {}\n", outline.frames,
             outline.rendered, flags_text(outline));
  if (outline.gap_count == 0) {
    fmt::print(out, "sequence    no gap\n");
    return;
  }
  fmt::print(out, "sequence    {} gaps, {} entries are missing; a replay stops at the first gap\n",
             outline.gap_count, outline.missing_entries);
  constexpr std::size_t kMaxGaps = 10;
  for (std::size_t i = 0; i < outline.gaps.size() && i < kMaxGaps; ++i) {
    fmt::print(out, "  missing   {} to {}\n", outline.gaps[i].first_missing,
               outline.gaps[i].last_missing);
  }
}

void print_info(std::FILE* out, const std::filesystem::path& file, const FileInfo& info) {
  const protocol::McapFacts& facts = info.outline.facts;
  fmt::print(out, "{}: {}\n", file.string(), info.title);
  fmt::print(out, "  size        {} bytes\n", facts.file_bytes);
  fmt::print(out, "  library     {}\n", facts.library.empty() ? "-" : facts.library);
  fmt::print(out, "  profile     {}\n", facts.profile.empty() ? "-" : facts.profile);
  fmt::print(out, "  end         {}\n", info.end_text);
  fmt::print(out, "  chunks      {}, compression {}\n", info.chunks, compression_text(info));
  for (const protocol::McapSchema& schema : info.outline.schemas) {
    fmt::print(out, "  schema      {}, {}, {} bytes\n", schema.name, schema.encoding,
               schema.data.size());
  }
  print_topics(out, info.outline);
  for (const protocol::LogHostRunOutline& run : info.outline.host_runs) {
    fmt::print(out, "\nhost run {}: {} host frames, numbers {} to {}, {} s to {} s\n", run.run_id,
               run.frames, run.first_frame, run.last_frame, sim_text(run.sim_time->first_ns),
               sim_text(run.sim_time->last_ns));
  }
  if (info.outline.journal_entries > 0) print_journal(out, info.outline);
}

Json json_of(const protocol::LogRunOutline& run) {
  Json json = Json::object();
  json.set("run_id", run.has_start ? Json(run.run_id) : Json());
  json.set("has_start", run.has_start).set("begins_process", run.begins_process);
  json.set("scenario", run.scenario_name).set("scenario_sha256", run.scenario_sha256);
  json.set("software", run.software).set("device", run.device).set("pacing", run.pacing);
  json.set("first_time_ns", run.first_time_ns);
  json.set("first_sequence", run.first_sequence).set("last_sequence", run.last_sequence);
  json.set("host_frames", run.host_frames).set("commands", run.commands);
  json.set("frames", run.frames).set("rendered", run.rendered);
  json.set("first_frame", run.first_frame).set("last_frame", run.last_frame);
  set_span(json, "log_time", run.log_time);
  set_span(json, "sim_time", run.sim_time);
  json.set("setup", setup_json(run));
  return json;
}

Json json_of(const std::filesystem::path& file, const FileInfo& info) {
  const LogOutline& outline = info.outline;
  Json json = Json::object();
  json.set("file", file.string()).set("kind", info.kind).set("bytes", outline.facts.file_bytes);
  json.set("library", outline.facts.library).set("profile", outline.facts.profile);
  json.set("end", info.end).set("end_text", info.end_text);
  json.set("chunks", info.chunks);
  Json compressions = Json::array();
  for (const std::string& name : info.compressions) compressions.push(name);
  json.set("compression", std::move(compressions)).set("index_only", info.index_only);
  json.set("attachments", outline.facts.attachments).set("metadata", outline.facts.metadata);
  Json schemas = Json::array();
  for (const protocol::McapSchema& schema : outline.schemas) {
    Json one = Json::object();
    one.set("name", schema.name).set("encoding", schema.encoding).set("bytes", schema.data.size());
    schemas.push(std::move(one));
  }
  json.set("schemas", std::move(schemas));
  Json topics = Json::array();
  for (const protocol::LogTopicOutline& topic : outline.topics) {
    Json one = Json::object();
    one.set("topic", topic.topic).set("message", topic.message).set("encoding", topic.encoding);
    one.set("messages", topic.messages);
    set_span(one, "log_time", topic.log_time);
    set_span(one, "sim_time", topic.sim_time);
    topics.push(std::move(one));
  }
  json.set("topics", std::move(topics));
  Json host_runs = Json::array();
  for (const protocol::LogHostRunOutline& run : outline.host_runs) {
    Json one = Json::object();
    one.set("run_id", run.run_id).set("host_frames", run.frames);
    one.set("first_frame", run.first_frame).set("last_frame", run.last_frame);
    set_span(one, "sim_time", run.sim_time);
    host_runs.push(std::move(one));
  }
  json.set("host_runs", std::move(host_runs));
  Json runs = Json::array();
  for (const protocol::LogRunOutline& run : outline.runs) runs.push(json_of(run));
  json.set("runs", std::move(runs));
  json.set("frames", outline.frames).set("rendered", outline.rendered);
  Json flags = Json::object();
  for (std::size_t bit = 0; bit < protocol::kFrameFlagNames.size(); ++bit) {
    flags.set(protocol::kFrameFlagNames[bit], outline.frames_with_flag[bit]);
  }
  json.set("frames_with_flag", std::move(flags));
  json.set("gap_count", outline.gap_count).set("missing_entries", outline.missing_entries);
  Json gaps = Json::array();
  for (const protocol::LogGap& gap : outline.gaps) {
    Json one = Json::object();
    one.set("first_missing", gap.first_missing).set("last_missing", gap.last_missing);
    gaps.push(std::move(one));
  }
  json.set("gaps", std::move(gaps));
  json.set("error", outline.damage ? Json(outline.damage->text) : Json());
  return json;
}

/// Describes a CSV pose log or a network capture, as far as their readers know them.
int describe_poses(const InfoOptions& command, bool csv) {
  auto log = PoseLog::open(command.log, command.host_port);
  if (!log) return fail(log.error());
  std::uint64_t frames = 0;
  std::uint64_t first_frame = 0;
  std::set<std::uint64_t> run_ids;
  std::optional<LogSpan> sim_time;
  constexpr std::size_t kMaxRunIds = 1000;
  while (!InterruptGuard::interrupted()) {
    const auto more = log->next();
    if (!more) return fail(more.error());
    if (!*more) break;
    if (frames++ == 0) first_frame = log->host().frame_number;
    if (run_ids.size() < kMaxRunIds) run_ids.insert(log->host().run_id);
    LogSpan::extend(sim_time, log->host().sim_time_ns);
  }
  std::FILE* out = text_stream(command.json);
  std::error_code error;
  const auto bytes = std::filesystem::file_size(command.log, error);
  fmt::print(out, "{}: {}\n", command.log.string(), csv ? "CSV pose log" : "network capture");
  fmt::print(out, "  size        {} bytes\n", error ? 0 : bytes);
  fmt::print(out, "  host frames {}, the first has number {}, {} run ids\n", frames, first_frame,
             run_ids.size());
  if (sim_time) {
    fmt::print(out, "  sim time    {} s to {} s\n", sim_text(sim_time->first_ns),
               sim_text(sim_time->last_ns));
  }
  const auto notes = log->notes();
  if (notes) warn(*notes);
  if (!command.json) return kExitOk;
  Json json = Json::object();
  json.set("file", command.log.string()).set("kind", csv ? "csv" : "capture");
  json.set("bytes", error ? 0 : bytes).set("host_frames", frames);
  set_span(json, "sim_time", sim_time);
  json.set("notes", notes ? Json(*notes) : Json());
  if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  return kExitOk;
}

int run_info(const InfoOptions& command) {
  const InterruptGuard interrupt;
  const bool csv = is_pose_csv(command.log);
  if (csv || protocol::PosePcapReader::is_capture(command.log)) return describe_poses(command, csv);
  std::error_code unknown;
  const auto bytes = std::filesystem::file_size(command.log, unknown);
  FileInfo info;
  {
    Progress progress("info", unknown ? 0 : bytes);
    auto outline = protocol::outline_log(command.log, [&](std::uint64_t done_bytes) {
      progress.advance_to(done_bytes);
      return !InterruptGuard::interrupted();
    });
    progress.finish();
    if (!outline) return fail(outline.error());
    info.outline = std::move(*outline);
  }
  if (auto judged = judge_end(command.log, info); !judged) return fail(judged.error());
  if (info.index_only) take_index(info);
  judge_kind(info);
  print_info(text_stream(command.json), command.log, info);
  if (command.json) {
    if (auto done = write_json(*command.json, json_of(command.log, info)); !done) {
      return fail(done.error());
    }
  }
  const auto& damage = info.outline.damage;
  if (!damage) return kExitOk;
  if (info.index_only) {
    warn("the counts come from the index: " + damage->text);
    return kExitOk;
  }
  return fail(*damage);
}

void add_info_options(CommandLine& line, InfoOptions& options) {
  line.path("log", options.log,
            "MCAP log, CSV with poses (*.csv), or a pcap/pcapng capture of a host's datagrams")
      .required();
  line.option("--host-port", options.host_port, "Capture: UDP port the host sent to")
      .type_name("PORT")
      .in_range(1, 65535)
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_log_info(CommandLine& log) {
  log.command<InfoOptions>(
      {.name = "info",
       .text = "Describe a log: kind, topics, runs, frames by flag, gaps, and how it ends",
       .example = "emit log info run.mcap --json -"},
      add_info_options, run_info);
}

}  // namespace emit::tool
