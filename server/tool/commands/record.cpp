// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <chrono>

#include "emit/client/client.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/frame_recorder.hpp"
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
  bool with_frames = false;
  std::string channel_name;
  std::optional<std::filesystem::path> json;
  client::Security security;
};

/// Writes the images that are still on their way. A daemon that ends closes the connection behind
/// them.
physics::Result<void> take_rest(FrameRecorder& images, protocol::LogWriter& log) {
  constexpr std::int64_t kPollNs = 20'000'000;
  constexpr std::chrono::seconds kLongest(2);
  const auto end = Clock::now() + kLongest;
  while (images.waits() && Clock::now() < end && !InterruptGuard::interrupted()) {
    if (const auto taken = images.take(log, kPollNs); !taken) return tl::unexpected(taken.error());
  }
  return {};
}

std::string text_of(const FrameRecorder& images) {
  const double ratio = images.stored_bytes() == 0 ? 1.0
                                                  : static_cast<double>(images.raw_bytes()) /
                                                        static_cast<double>(images.stored_bytes());
  return fmt::format(
      "{} images, {} MB, compressed {:.2f} to 1; {} compared with the journal, {} "
      "differ, {} lost\n",
      images.images(), images.stored_bytes() / 1'000'000, ratio, images.compared(), images.differ(),
      images.lost());
}

int run(const RecordOptions& command) {
  const auto url = client::parse_url(command.from);
  if (!url) return fail(kExitUsage, url.error().text);
  auto connected =
      client::RecorderClient::connect(command.from, client::kConnectTimeoutNs, command.security);
  if (!connected) return fail_call(connected.error());
  client::RecorderClient& recorder = **connected;
  std::optional<FrameRecorder> images;
  if (command.with_frames) {
    auto subscribed = FrameRecorder::connect(command.from, command.channel_name, command.security);
    if (!subscribed) return fail_call(subscribed.error());
    images.emplace(std::move(*subscribed));
  }
  protocol::LogWriterOptions options;
  options.frames = command.with_frames;
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
  std::string images_ended;  // why no further image comes
  const auto take_images = [&](std::int64_t timeout_ns) {
    if (!images || !images_ended.empty()) return;
    if (const auto taken = images->take(*writer, timeout_ns); !taken) {
      images_ended = taken.error().text;
    }
  };
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
    take_images(0);
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
    if (images) images->note(entry);
    if (auto written = writer->write_journal(entry); !written) return fail(written.error());
    if (!unflushed) unflushed_since = Clock::now();
    unflushed = true;
    if (command.frames != 0) progress.advance_to(frames);
  }
  progress.finish();
  if (images && images_ended.empty()) {
    if (const auto rest = take_rest(*images, *writer); !rest) images_ended = rest.error().text;
  }
  if (closed) warn("the daemon closed the connection: the log ends there");
  if (auto done = writer->close(); !done) return fail(done.error());
  fmt::print(text_stream(command.json), "{}: {} entries, {} host frames, {} frames\n",
             command.out.string(), entries, host_frames, frames);
  if (images) fmt::print(text_stream(command.json), "{}", text_of(*images));
  if (command.json) {
    Json json = Json::object();
    json.set("entries", entries).set("host_frames", host_frames).set("frames", frames);
    json.set("lost_entries", lost_entries).set("from_the_start", from_the_start);
    if (images) {
      json.set("images", images->images()).set("image_bytes", images->raw_bytes());
      json.set("stored_image_bytes", images->stored_bytes());
      json.set("images_compared", images->compared()).set("images_differ", images->differ());
      json.set("images_lost", images->lost());
    }
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
  if (!images) return kExitOk;
  if (!images_ended.empty() && !closed) {
    return fail(kExitFailure, "images ended before the journal: " + images_ended);
  }
  if (images->differ() + images->lost() > 0) {
    return fail(kExitFailure, fmt::format("{} images differ from the journal, {} were lost",
                                          images->differ(), images->lost()));
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
  Option with_frames = line.flag("--with-frames", options.with_frames,
                                 "Record the images of a channel too, compressed without loss; "
                                 "emit log export exr writes them as files");
  line.option("--channel-name", options.channel_name,
              "With --with-frames: channel by name; default: the first")
      .type_name("NAME")
      .needs(with_frames);
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
