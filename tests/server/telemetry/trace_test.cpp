// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "telemetry/frame_trace.hpp"

namespace emit::server {
namespace {

protocol::FrameHeader header(std::uint64_t number, std::int64_t received_ns) {
  protocol::FrameHeader out;
  out.run_id = 7;
  out.frame_number = number;
  out.host_frame_number = number;
  out.host_received_ns = received_ns;
  out.render_start_ns = received_ns + 1'000;
  out.render_end_ns = received_ns + 4'500;
  out.readback_end_ns = received_ns + 5'000;
  out.send_start_ns = received_ns + 6'000;
  return out;
}

struct Event {
  std::string name;
  int pid = 0;
  int tid = 0;
  double ts_us = 0.0;
  double dur_us = 0.0;
};

/// Returns complete events, one a line. Metadata lines give the processes' names.
struct Parsed {
  std::vector<Event> events;
  std::map<int, std::string> processes;
  explicit Parsed(const std::string& text) {
    static const std::regex kEvent(
        R"re(\{"ph":"X","cat":"frame","name":"([^"]*)","pid":(\d+),"tid":(\d+),"ts":([0-9.]+),"dur":([0-9.]+)(,"args":\{[^{}]*\})?\},?)re");
    static const std::regex kProcess(
        R"re(\{"ph":"M","name":"process_name","pid":(\d+),"tid":0,"args":\{"name":"([^"]*)"\}\},?)re");
    EXPECT_TRUE(text.starts_with("{\"displayTimeUnit\":\"ms\",")) << text.substr(0, 80);
    EXPECT_TRUE(text.ends_with("\n]}\n"));
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    EXPECT_TRUE(line.ends_with("\"traceEvents\":[")) << line;
    bool comma_before = true;
    while (std::getline(lines, line) && line != "]}") {
      std::smatch match;
      EXPECT_TRUE(comma_before) << "no comma in front of: " << line;
      comma_before = line.ends_with(',');
      if (std::regex_match(line, match, kProcess)) {
        processes[std::stoi(match[1])] = match[2];
      } else if (std::regex_match(line, match, kEvent)) {
        events.push_back({match[1], std::stoi(match[2]), std::stoi(match[3]), std::stod(match[4]),
                          std::stod(match[5])});
      } else {
        ADD_FAILURE() << "neither event nor process: " << line;
      }
    }
    EXPECT_FALSE(comma_before) << "a comma behind the last";
  }
  [[nodiscard]] const Event* find(const std::string& name, int pid) const {
    for (const Event& event : events) {
      if (event.name == name && event.pid == pid) return &event;
    }
    return nullptr;
  }
};

/// Expects that on every track two events follow one another or one holds the other.
void expect_nesting(const Parsed& trace) {
  for (const Event& a : trace.events) {
    for (const Event& b : trace.events) {
      if (&a == &b || a.pid != b.pid || a.tid != b.tid) continue;
      const double a_end = a.ts_us + a.dur_us;
      const double b_end = b.ts_us + b.dur_us;
      constexpr double kRoundUs = 1e-6;
      const bool apart = a_end <= b.ts_us + kRoundUs || b_end <= a.ts_us + kRoundUs;
      const bool a_holds_b = a.ts_us <= b.ts_us + kRoundUs && b_end <= a_end + kRoundUs;
      const bool b_holds_a = b.ts_us <= a.ts_us + kRoundUs && a_end <= b_end + kRoundUs;
      EXPECT_TRUE(apart || a_holds_b || b_holds_a)
          << a.name << " and " << b.name << " cross on track " << a.pid << "/" << a.tid;
    }
  }
}

TEST(FrameTrace, KeepsTheNewestEntriesInOrder) {
  FrameTrace trace;
  EXPECT_TRUE(trace.entries().empty());
  for (std::uint64_t n = 1; n <= FrameTrace::kEntries + 5; ++n) {
    trace.add(header(n, static_cast<std::int64_t>(n) * 1'000'000), 3, 9);
  }
  const auto entries = trace.entries();
  ASSERT_EQ(entries.size(), FrameTrace::kEntries);
  EXPECT_EQ(entries.front().frame_number, 6U);
  EXPECT_EQ(entries.back().frame_number, FrameTrace::kEntries + 5);
  EXPECT_EQ(entries.back().client, 3U);
  EXPECT_EQ(entries.back().last_byte_ns, 9);
}

TEST(ChromeTrace, ShowsStagesInMicrosecondsInsideTheirFrame) {
  FrameTrace trace;
  constexpr std::int64_t kStartNs = 1'800'000'000'000'000'123;
  trace.add(header(1, kStartNs), 2, kStartNs + 9'250);
  const Parsed parsed(chrome_trace(trace.entries()));
  expect_nesting(parsed);
  EXPECT_EQ(parsed.processes.at(1), "frames");
  EXPECT_EQ(parsed.processes.at(2), "client 2");
  const Event* frame = parsed.find("frame 1", 1);
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->ts_us, 0.0) << "times count from the first instant";
  EXPECT_EQ(frame->dur_us, 5.0);
  const Event* render = parsed.find("render", 1);
  ASSERT_NE(render, nullptr);
  EXPECT_EQ(render->ts_us, 1.0);
  EXPECT_EQ(render->dur_us, 3.5);
  const Event* send = parsed.find("send", 2);
  ASSERT_NE(send, nullptr);
  EXPECT_EQ(send->ts_us, 6.0);
  EXPECT_EQ(send->dur_us, 3.25);
  EXPECT_NE(chrome_trace(trace.entries()).find("\"origin_wall_ns\":\"1800000000000000123\""),
            std::string::npos);
}

TEST(ChromeTrace, NestsWhateverOverlaps) {
  FrameTrace trace;
  // Frames overlap, three clients share them, one frame was repeated, one has a clock set back.
  for (std::uint64_t n = 1; n <= 40; ++n) {
    auto frame = header(n, 1'000'000 + static_cast<std::int64_t>(n) * 2'000);
    frame.slot_begin_ns = n % 3 == 0 ? frame.host_received_ns + 500 : 0;
    if (n % 7 == 0) {
      frame.flags |= protocol::kFlagRepeated;
      frame.slot_begin_ns = frame.send_start_ns - 100;
    }
    if (n == 20) frame.render_end_ns -= 900'000;
    for (std::uint64_t client = 0; client < 3; ++client) {
      trace.add(frame, client == 2 ? FrameTrace::kSharedMemory : client,
                frame.send_start_ns + 1'000 * static_cast<std::int64_t>(client + 1));
    }
  }
  const Parsed parsed(chrome_trace(trace.entries()));
  expect_nesting(parsed);
  EXPECT_EQ(parsed.processes.at(4), "shared memory");
  int made = 0;
  for (const Event& event : parsed.events) made += event.pid == 1 && event.name == "render";
  EXPECT_EQ(made, 35) << "each frame once, repeated ones not at all";
}

TEST(ChromeTrace, IsSoundWithoutFrames) {
  const Parsed parsed(chrome_trace({}));
  EXPECT_TRUE(parsed.events.empty());
}

}  // namespace
}  // namespace emit::server
