// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <chrono>

#include "emit/client/client.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/stream_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;

struct RecordOptions {
  std::string from;
  std::filesystem::path out;
  std::uint64_t frames = 0;
  double duration_s = 0.0;
  std::optional<std::filesystem::path> json;
  client::Security security;
};

int run(const RecordOptions& command) {
  const auto url = client::parse_url(command.from);
  if (!url) return fail(kExitUsage, url.error().text);
  auto connected =
      client::RecorderClient::connect(command.from, client::kConnectTimeoutNs, command.security);
  if (!connected) return fail_call(connected.error());
  client::RecorderClient& recorder = **connected;
  protocol::LogWriterOptions options;
  options.software = fmt::format("emit {} record", kVersion);
  auto writer = protocol::LogWriter::create(command.out, options);
  if (!writer) return fail(writer.error());

  const InterruptGuard interrupt;
  const auto start = Clock::now();
  const auto end = command.duration_s > 0.0
                       ? start + std::chrono::duration_cast<Clock::duration>(
                                     std::chrono::duration<double>(command.duration_s))
                       : Clock::time_point::max();
  Progress progress("frames", command.frames);
  v1::JournalEntry entry;
  std::uint64_t entries = 0;
  std::uint64_t frames = 0;
  std::uint64_t host_frames = 0;
  std::uint64_t lost_entries = 0;
  std::uint64_t last_sequence = 0;
  bool from_the_start = true;
  bool closed = false;
  std::string broken;
  // A killed process loses no more than what came in this time and in one poll.
  constexpr auto kFlushAfter = std::chrono::milliseconds(50);
  bool unflushed = false;
  Clock::time_point unflushed_since;
  const auto flush_when_due = [&]() -> physics::Result<void> {
    if (!unflushed || Clock::now() - unflushed_since < kFlushAfter) return {};
    unflushed = false;
    return writer->flush();
  };
  while (!InterruptGuard::interrupted() && Clock::now() < end &&
         (command.frames == 0 || frames < command.frames)) {
    if (auto flushed = flush_when_due(); !flushed) return fail(flushed.error());
    constexpr std::int64_t kPollNs = 20'000'000;
    const auto received = recorder.receive(entry, kPollNs);
    if (!received) {
      if (!recorder.closed()) broken = received.error().text;
      closed = recorder.closed();
      break;
    }
    if (!*received) {
      closed = recorder.closed();
      if (closed) break;
      continue;
    }
    if (entries > 0 && entry.sequence() != last_sequence + 1) {
      lost_entries += entry.sequence() - last_sequence - 1;
    }
    if (entries == 0 && !entry.has_run_start()) {
      // The daemon keeps journal.memory_mib of a run for recorders that connect later.
      from_the_start = false;
      const client::JournalGap& gap = recorder.gap();
      warn(fmt::format(
          "the run began longer ago than the daemon remembers (journal.memory_mib): {} the log "
          "does not replay until the next run begins",
          gap.entries() == 0 ? std::string()
                             : fmt::format("{} entries, sequence {} to {}, are lost;",
                                           gap.entries(), gap.first_sequence, gap.last_sequence)));
    }
    last_sequence = entry.sequence();
    ++entries;
    if (entry.has_frame()) ++frames;
    if (entry.has_host_frame()) ++host_frames;
    if (auto written = writer->write_journal(entry); !written) return fail(written.error());
    if (!unflushed) unflushed_since = Clock::now();
    unflushed = true;
    if (command.frames != 0) progress.advance_to(frames);
  }
  progress.finish();
  if (closed) warn("the daemon closed the connection: the log ends there");
  if (auto done = writer->close(); !done) return fail(done.error());
  fmt::print(text_stream(command.json), "{}: {} entries, {} host frames, {} frames\n",
             command.out.string(), entries, host_frames, frames);
  if (command.json) {
    Json json = Json::object();
    json.set("entries", entries).set("host_frames", host_frames).set("frames", frames);
    json.set("lost_entries", lost_entries).set("from_the_start", from_the_start);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  if (!broken.empty()) return fail(kExitFailure, broken);
  if (lost_entries > 0) {
    return fail(kExitFailure,
                fmt::format("{} journal entries were lost: the log does not replay", lost_entries));
  }
  if (!from_the_start) {
    return fail(kExitFailure, "the log begins in the middle of a run, which does not replay");
  }
  return kExitOk;
}

void add_options(CommandLine& line, RecordOptions& options) {
  line.option("--from", options.from, "Control address of the daemon, tcp://host:port")
      .required()
      .type_name("URL");
  line.output_file("--out", options.out, "MCAP log to write").required();
  add_security(line, options.security);
  line.count("--frames", options.frames, "Stop after this many frames; 0: no limit");
  line.seconds("--duration-s", options.duration_s, "Stop after this long; 0: until interrupted");
  add_json(line, options.json);
}

}  // namespace

void add_record(CommandLine& tool) {
  tool.command<RecordOptions>(
      {.name = "record",
       .text = "Fetch the daemon's journal into a log that replay can apply",
       .example = "emit record --from tcp://127.0.0.1:7000 --out run.mcap"},
      add_options, run);
}

}  // namespace emit::tool
