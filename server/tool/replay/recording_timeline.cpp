// SPDX-License-Identifier: Apache-2.0
#include "tool/replay/recording_timeline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "emit/protocol/control.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "tool/support/interrupt.hpp"

namespace emit::tool {
physics::Result<RecordingTimeline> RecordingTimeline::read(const std::filesystem::path& log,
                                                           std::size_t first_run,
                                                           std::size_t last_run) {
  auto reader = protocol::LogReader::open(log);
  if (!reader) return tl::unexpected(reader.error());
  RecordingTimeline out;
  std::size_t begun = 0;
  for (;;) {
    if (InterruptGuard::interrupted()) {
      return physics::make_error(physics::ErrorCode::internal, "interrupted");
    }
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    if (reader->topic() != protocol::LogTopic::journal) continue;
    const v1::JournalEntry& entry = reader->journal();
    if (entry.has_run_start() || begun == 0) ++begun;
    if (begun - 1 < first_run) continue;
    if (begun - 1 > last_run) break;
    out.add(entry);
  }
  return out;
}

void RecordingTimeline::mark(std::string_view kind, std::string text) {
  if (marks_.size() < kMaxMarks) marks_.push_back({frames_.size(), kind, std::move(text)});
}

void RecordingTimeline::add(const v1::JournalEntry& entry) {
  if (entry.sequence() <= last_sequence_) new_daemon_ = true;
  last_sequence_ = entry.sequence();
  if (entry.has_run_start()) {
    runs_.push_back({entry.run_start().run_id(), frames_.size()});
    mark("run", fmt::format("run {}", entry.run_start().run_id()));
  } else if (entry.has_command()) {
    mark("command",
         std::string(protocol::command_name(static_cast<std::uint64_t>(entry.command().kind()))));
  } else if (entry.has_host_frame()) {
    if (entry.host_frame().has_environment()) mark("weather", "weather of the host");
    if (entry.host_frame().parts_size() > 0) mark("part", "a part is driven");
  } else if (entry.has_frame()) {
    const v1::FrameDecision& frame = entry.frame();
    if ((frame.flags() & protocol::kFlagLate) != 0) {
      mark("late", fmt::format("frame {} was late", frame.frame_number()));
    }
    const std::int64_t before_ns = frames_.empty() ? 0 : frames_.back().position_ns;
    if (new_daemon_) {
      offset_ns_ = entry.wall_time_ns() - before_ns;
      new_daemon_ = false;
    }
    frames_.push_back({std::max(before_ns, entry.wall_time_ns() - offset_ns_), frame.sim_time_ns(),
                       frame.frame_number(),
                       static_cast<std::uint32_t>(runs_.empty() ? 0 : runs_.size() - 1)});
  }
}

std::size_t RecordingTimeline::frame_at(std::int64_t position_ns) const noexcept {
  const auto found = std::ranges::lower_bound(frames_, position_ns, {}, &Frame::position_ns);
  return std::min(static_cast<std::size_t>(found - frames_.begin()), frames_.size() - 1);
}

std::string RecordingTimeline::json() const {
  std::string out;
  const auto add = [&]<class... Values>(fmt::format_string<Values...> text, Values&&... values) {
    fmt::format_to(std::back_inserter(out), text, std::forward<Values>(values)...);
  };
  const auto position_s = [&](std::size_t frame) {
    return frames_.empty() ? 0.0
                           : in_seconds(frames_[std::min(frame, frames_.size() - 1)].position_ns);
  };
  add(R"({{"frames":{},"length_s":{:.9f},"runs":[)", frames_.size(), position_s(frames_.size()));
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    add(R"({}{{"id":"{}","from_s":{:.9f}}})", i == 0 ? "" : ",", runs_[i].run_id,
        position_s(runs_[i].first_frame));
  }
  out += "],\"marks\":[";
  for (std::size_t i = 0; i < marks_.size(); ++i) {
    add(R"({}["{}",{:.9f},"{}"])", i == 0 ? "" : ",", marks_[i].kind, position_s(marks_[i].frame),
        marks_[i].text);
  }
  out += "],\"times\":[";
  constexpr std::size_t kMostPoints = 1000;
  const std::size_t step = frames_.size() / kMostPoints + 1;
  for (std::size_t i = 0; i < frames_.size(); i += step) {
    add("{}[{:.9f},{:.9f}]", i == 0 ? "" : ",", position_s(i), in_seconds(frames_[i].sim_time_ns));
  }
  return out + "]}";
}

}  // namespace emit::tool
