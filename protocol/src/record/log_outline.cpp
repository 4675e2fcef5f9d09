// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log_outline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "record/log_message.hpp"

namespace emit::protocol {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Messages between two reports of progress.
constexpr std::uint64_t kReportEvery = 256;

/// Describes messages one by one.
class OutlineMaker {
 public:
  explicit OutlineMaker(LogOutline& out) : out_(out) {}

  Result<void> add(const McapReader& reader) {
    const auto topic = decoder_.decode(reader);
    if (!topic) return tl::unexpected(topic.error());
    const McapMessage& message = reader.message();
    const auto log_time_ns = static_cast<std::int64_t>(message.log_time_ns);
    LogTopicOutline& outline = topic_of(reader, message.channel_id);
    ++outline.messages;
    LogSpan::extend(outline.log_time, log_time_ns);
    if (!*topic) return {};
    if (**topic == LogTopic::host) {
      LogSpan::extend(outline.sim_time, decoder_.host().sim_time_ns);
      add_host(decoder_.host());
    } else {
      add_entry(decoder_.journal(), log_time_ns, outline.sim_time);
    }
    return {};
  }

 private:
  LogTopicOutline& topic_of(const McapReader& reader, std::uint16_t channel_id) {
    const auto known = topics_.find(channel_id);
    if (known != topics_.end()) return out_.topics[known->second];
    const McapChannel& channel = *reader.channel(channel_id);
    const McapSchema* schema = reader.schema(channel.schema_id);
    const std::string message = schema != nullptr ? schema->name : std::string();
    const auto same = std::ranges::find_if(out_.topics, [&](const LogTopicOutline& topic) {
      return topic.topic == channel.topic && topic.message == message &&
             topic.encoding == channel.message_encoding;
    });
    const auto place = static_cast<std::size_t>(same - out_.topics.begin());
    if (same == out_.topics.end()) {
      LogTopicOutline& topic = out_.topics.emplace_back();
      topic.topic = channel.topic;
      topic.message = message;
      topic.encoding = channel.message_encoding;
    }
    topics_.emplace(channel_id, place);
    return out_.topics[place];
  }

  void add_host(const HostFrameData& frame) {
    if (out_.host_runs.empty() || out_.host_runs.back().run_id != frame.run_id) {
      LogHostRunOutline& run = out_.host_runs.emplace_back();
      run.run_id = frame.run_id;
      run.first_frame = frame.frame_number;
    }
    LogHostRunOutline& run = out_.host_runs.back();
    ++run.frames;
    run.last_frame = frame.frame_number;
    LogSpan::extend(run.sim_time, frame.sim_time_ns);
  }

  void add_entry(const v1::JournalEntry& entry, std::int64_t log_time_ns,
                 std::optional<LogSpan>& sim_time) {
    const bool first = out_.journal_entries++ == 0;
    const bool begins_process =
        entry.has_run_start() && (first || entry.sequence() <= last_sequence_);
    if (!first && !begins_process && entry.sequence() != last_sequence_ + 1) {
      add_gap(entry.sequence());
    }
    last_sequence_ = entry.sequence();
    if (entry.has_run_start() || out_.runs.empty()) begin_run(entry, begins_process);
    LogRunOutline& run = out_.runs.back();
    run.last_sequence = entry.sequence();
    LogSpan::extend(run.log_time, log_time_ns);
    if (entry.has_host_frame()) {
      ++run.host_frames;
      LogSpan::extend(sim_time, entry.host_frame().sim_time_ns());
    } else if (entry.has_command()) {
      ++run.commands;
    } else if (entry.has_frame()) {
      LogSpan::extend(sim_time, entry.frame().sim_time_ns());
      add_frame(run, entry.frame());
    }
  }

  /// Counts what is missing in front of an entry. A number that goes back tells of no size.
  void add_gap(std::uint64_t sequence) {
    ++out_.gap_count;
    if (sequence <= last_sequence_) return;
    out_.missing_entries += sequence - last_sequence_ - 1;
    if (out_.gaps.size() < LogOutline::kMaxGaps) {
      out_.gaps.push_back({last_sequence_ + 1, sequence - 1});
    }
  }

  void begin_run(const v1::JournalEntry& entry, bool begins_process) {
    LogRunOutline& run = out_.runs.emplace_back();
    run.first_sequence = entry.sequence();
    run.begins_process = begins_process || out_.runs.size() == 1;
    if (!entry.has_run_start()) return;
    const v1::RunStart& start = entry.run_start();
    run.has_start = true;
    run.run_id = start.run_id();
    run.scenario_name = start.scenario_name();
    run.scenario_sha256 = start.scenario_sha256();
    run.software = start.software();
    run.device = start.device();
    run.pacing = start.pacing();
    run.first_time_ns = start.first_time_ns();
    if (start.has_recording()) run.recording = shared(start.recording());
  }

  /// Returns the setup that an earlier run has, where it is the same.
  std::shared_ptr<const v1::Recording> shared(const v1::Recording& recording) {
    std::string bytes = recording.SerializeAsString();
    if (recording_ == nullptr || bytes != recording_bytes_) {
      recording_ = std::make_shared<const v1::Recording>(recording);
      recording_bytes_ = std::move(bytes);
    }
    return recording_;
  }

  void add_frame(LogRunOutline& run, const v1::FrameDecision& frame) {
    if (run.frames++ == 0) run.first_frame = frame.frame_number();
    run.last_frame = frame.frame_number();
    run.rendered += frame.rendered() ? 1U : 0U;
    LogSpan::extend(run.sim_time, frame.sim_time_ns());
    ++out_.frames;
    out_.rendered += frame.rendered() ? 1U : 0U;
    for (std::size_t bit = 0; bit < out_.frames_with_flag.size(); ++bit) {
      out_.frames_with_flag[bit] += (frame.flags() >> bit) & 1U;
    }
  }

  LogOutline& out_;
  LogMessageDecoder decoder_;
  std::map<std::uint16_t, std::size_t> topics_;  ///< place in LogOutline::topics by channel
  std::uint64_t last_sequence_ = 0;
  std::shared_ptr<const v1::Recording> recording_;  // of the newest run that has one
  std::string recording_bytes_;
};

}  // namespace

void LogSpan::extend(std::optional<LogSpan>& span, std::int64_t at_ns) noexcept {
  if (!span) {
    span = LogSpan{at_ns, at_ns};
    return;
  }
  span->first_ns = std::min(span->first_ns, at_ns);
  span->last_ns = std::max(span->last_ns, at_ns);
}

Result<LogOutline> outline_log(const std::filesystem::path& path, const LogProgress& progress) {
  auto reader = McapReader::open(path);
  if (!reader) return tl::unexpected(reader.error());
  LogOutline out;
  OutlineMaker maker(out);
  for (std::uint64_t count = 0;; ++count) {
    const auto more = reader->next();
    if (!more) {
      out.damage = more.error();
      break;
    }
    if (!*more) break;
    if (auto added = maker.add(*reader); !added) {
      out.damage = added.error();
      break;
    }
    if (progress && count % kReportEvery == 0 && !progress(reader->message().file_offset)) {
      return make_error(ErrorCode::internal, path.string() + ": stopped while reading");
    }
  }
  out.facts = reader->facts();
  out.truncation = reader->truncation();
  for (const auto& [id, schema] : reader->schemas()) out.schemas.push_back(schema);
  // A topic without a message is one of the file all the same.
  for (const auto& [id, channel] : reader->channels()) {
    const McapSchema* schema = reader->schema(channel.schema_id);
    const std::string message = schema != nullptr ? schema->name : std::string();
    const bool listed = std::ranges::any_of(
        out.topics, [&name = channel.topic, &message](const LogTopicOutline& topic) {
          return topic.topic == name && topic.message == message;
        });
    if (!listed) {
      LogTopicOutline& topic = out.topics.emplace_back();
      topic.topic = channel.topic;
      topic.message = message;
      topic.encoding = channel.message_encoding;
    }
  }
  return out;
}

}  // namespace emit::protocol
