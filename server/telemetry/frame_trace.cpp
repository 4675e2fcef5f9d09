// SPDX-License-Identifier: Apache-2.0
#include "telemetry/frame_trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <map>
#include <set>
#include <utility>

namespace emit::server {

void FrameTrace::add(const protocol::FrameHeader& header, std::uint64_t client,
                     std::int64_t last_byte_ns) noexcept {
  Entry entry;
  entry.run_id = header.run_id;
  entry.frame_number = header.frame_number;
  entry.host_frame_number = header.host_frame_number;
  entry.client = client;
  entry.flags = header.flags;
  entry.host_received_ns = header.host_received_ns;
  entry.slot_begin_ns = header.slot_begin_ns;
  entry.render_start_ns = header.render_start_ns;
  entry.render_end_ns = header.render_end_ns;
  entry.readback_end_ns = header.readback_end_ns;
  entry.send_start_ns = header.send_start_ns;
  entry.last_byte_ns = last_byte_ns;
  const auto words = std::bit_cast<std::array<std::uint64_t, kWords>>(entry);
  const std::uint64_t number = added_.load(std::memory_order_relaxed);
  Place& place = places_[number % kEntries];
  // Releasing each word keeps it behind the odd sequence for whoever acquires it.
  place.sequence.store(2 * number + 1, std::memory_order_relaxed);
  for (std::size_t i = 0; i < kWords; ++i) {
    place.words[i].store(words[i], std::memory_order_release);
  }
  place.sequence.store(2 * number + 2, std::memory_order_release);
  added_.store(number + 1, std::memory_order_release);
}

std::vector<FrameTrace::Entry> FrameTrace::entries() const {
  const std::uint64_t end = added_.load(std::memory_order_acquire);
  std::vector<Entry> out;
  for (std::uint64_t number = end - std::min<std::uint64_t>(end, kEntries); number < end;
       ++number) {
    const Place& place = places_[number % kEntries];
    if (place.sequence.load(std::memory_order_acquire) != 2 * number + 2) continue;
    std::array<std::uint64_t, kWords> words{};
    for (std::size_t i = 0; i < kWords; ++i) {
      words[i] = place.words[i].load(std::memory_order_acquire);
    }
    if (place.sequence.load(std::memory_order_relaxed) != 2 * number + 2) continue;
    out.push_back(std::bit_cast<Entry>(words));
  }
  return out;
}

namespace {

struct Stage {
  const char* name;
  std::int64_t begin_ns;
  std::int64_t end_ns;
};

/// Returns the stages of one frame, from the first instant that happened to the last, without steps
/// back (a clock may have been set in between).
std::vector<Stage> stages_of(const std::vector<std::pair<const char*, std::int64_t>>& instants) {
  std::vector<Stage> out;
  std::int64_t last_ns = 0;
  for (const auto& [name, ns] : instants) {
    if (ns == 0) continue;
    if (last_ns == 0) {
      last_ns = ns;
      continue;
    }
    const std::int64_t end_ns = std::max(ns, last_ns);
    out.push_back({name, last_ns, end_ns});
    last_ns = end_ns;
  }
  return out;
}

/// Rows on which intervals that begin one after another do not overlap.
class Lanes {
 public:
  [[nodiscard]] std::size_t place(std::int64_t begin_ns, std::int64_t end_ns) {
    for (std::size_t lane = 0; lane < free_from_ns_.size(); ++lane) {
      if (free_from_ns_[lane] <= begin_ns) {
        free_from_ns_[lane] = end_ns;
        return lane;
      }
    }
    free_from_ns_.push_back(end_ns);
    return free_from_ns_.size() - 1;
  }
  [[nodiscard]] std::size_t count() const noexcept { return free_from_ns_.size(); }

 private:
  std::vector<std::int64_t> free_from_ns_;
};

/// One interval with its stages inside.
struct Span {
  const FrameTrace::Entry* entry;
  std::vector<Stage> stages;
  [[nodiscard]] std::int64_t begin_ns() const { return stages.front().begin_ns; }
  [[nodiscard]] std::int64_t end_ns() const { return stages.back().end_ns; }
};

class TraceText {
 public:
  explicit TraceText(std::int64_t base_ns) : base_ns_(base_ns) {}

  void process(std::size_t pid, const std::string& name, std::vector<Span> spans) {
    std::ranges::stable_sort(spans, {}, &Span::begin_ns);
    line(
        fmt::format(R"({{"ph":"M","name":"process_name","pid":{},"tid":0,"args":{{"name":"{}"}}}})",
                    pid, name));
    Lanes lanes;
    for (const Span& span : spans) {
      const std::size_t lane = lanes.place(span.begin_ns(), span.end_ns()) + 1;
      const FrameTrace::Entry& entry = *span.entry;
      event(fmt::format("frame {}", entry.frame_number), pid, lane, span.begin_ns(), span.end_ns(),
            fmt::format(R"(,"args":{{"frame":{},"host_frame":{},"run_id":"{}","flags":{}}})",
                        entry.frame_number, entry.host_frame_number, entry.run_id, entry.flags));
      for (const Stage& stage : span.stages) {
        event(stage.name, pid, lane, stage.begin_ns, stage.end_ns, "");
      }
    }
  }

  [[nodiscard]] std::string text() const {
    return fmt::format(
        "{{\"displayTimeUnit\":\"ms\",\"otherData\":{{\"origin_wall_ns\":\"{}\"}},"
        "\"traceEvents\":[\n{}\n]}}\n",
        base_ns_, events_);
  }

 private:
  void event(std::string_view name, std::size_t pid, std::size_t lane, std::int64_t begin_ns,
             std::int64_t end_ns, const std::string& more) {
    line(fmt::format(
        R"({{"ph":"X","cat":"frame","name":"{}","pid":{},"tid":{},"ts":{},"dur":{}{}}})", name, pid,
        lane, microseconds(begin_ns - base_ns_), microseconds(end_ns - begin_ns), more));
  }
  void line(const std::string& text) {
    if (!events_.empty()) events_ += ",\n";
    events_ += text;
  }
  static std::string microseconds(std::int64_t ns) {
    return fmt::format("{}.{:03}", ns / 1000, ns % 1000);
  }

  std::int64_t base_ns_;
  std::string events_;
};

}  // namespace

std::string chrome_trace(const std::vector<FrameTrace::Entry>& entries) {
  std::vector<Span> frames;
  std::map<std::uint64_t, std::vector<Span>> sent;  // by client
  std::set<std::pair<std::uint64_t, std::uint64_t>> seen;
  std::int64_t base_ns = std::numeric_limits<std::int64_t>::max();
  const auto keep = [&](std::vector<Span>& to, Span span) {
    if (span.stages.empty()) return;
    base_ns = std::min(base_ns, span.begin_ns());
    to.push_back(std::move(span));
  };
  for (const FrameTrace::Entry& entry : entries) {
    // A repeated frame was not made anew, and its pixels have been waiting since before its slot.
    const bool repeated = (entry.flags & protocol::kFlagRepeated) != 0;
    if (!repeated && seen.emplace(entry.run_id, entry.frame_number).second) {
      keep(frames, {&entry, stages_of({{"received", entry.host_received_ns},
                                       {"sampling", entry.slot_begin_ns},
                                       {"wait", entry.render_start_ns},
                                       {"render", entry.render_end_ns},
                                       {"readback", entry.readback_end_ns}})});
    }
    keep(sent[entry.client],
         {&entry, stages_of({{"ready", repeated ? entry.slot_begin_ns : entry.readback_end_ns},
                             {repeated ? "repeat" : "queue", entry.send_start_ns},
                             {"send", entry.last_byte_ns}})});
  }
  TraceText out(base_ns == std::numeric_limits<std::int64_t>::max() ? 0 : base_ns);
  out.process(1, "frames", std::move(frames));
  std::size_t pid = 2;
  for (auto& [client, spans] : sent) {
    out.process(pid++,
                client == FrameTrace::kSharedMemory ? std::string("shared memory")
                                                    : fmt::format("client {}", client),
                std::move(spans));
  }
  return out.text();
}

}  // namespace emit::server
