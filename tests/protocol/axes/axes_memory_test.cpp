// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/axes_memory.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>

#include "support/heap_counter.hpp"

namespace emit::protocol {
namespace {

AxesCommand some_command(std::uint64_t counter) {
  AxesCommand out;
  out.counter = counter;
  out.time_ns = 1'800'000'000'000'000'005;
  out.sim_time_ns = -42;
  out.period_us = 1000;
  out.timeout_ms = 20;
  out.mode = AxesMode::follow;
  out.count = 2;
  out.axes[0] = {0.25, -1.5, 3.0};
  out.axes[1] = {-2.0, 0.5, -8.0};
  return out;
}

AxesMonitor some_monitor(std::uint64_t counter) {
  AxesMonitor out;
  out.counter = counter;
  out.time_ns = 17;
  out.command_counter = 77;
  out.state = AxesState::following;
  out.limited_axes = 0b10001;
  out.faulty_axes = 0b00100;
  out.timed_out = true;
  out.count = 5;
  for (std::size_t i = 0; i < out.count; ++i) {
    const double k = static_cast<double>(i) + 1.0;
    out.measured[i] = {0.1 * k, -20.0 * k, 3000.0 * k};
    out.demanded[i] = {0.2 * k, 40.0 * k, -1.0 * k};
  }
  return out;
}

/// Memory of both blocks, with access to single numbers at their documented places.
struct Memory {
  std::array<std::uint64_t, kAxesMemoryBytes / 8> words{};

  AxesCommandBlock command() { return AxesCommandBlock(words.data(), kAxesCommandWords); }
  AxesMonitorBlock monitor() {
    return AxesMonitorBlock(words.data() + kAxesMonitorAtBytes / 8, kAxesMonitorWords);
  }
  template <class Number>
  Number at(std::size_t byte) const {
    Number out;
    std::memcpy(&out, reinterpret_cast<const char*>(words.data()) + byte, sizeof(out));
    return out;
  }
  template <class Number>
  void set(std::size_t byte, Number number) {
    std::memcpy(reinterpret_cast<char*>(words.data()) + byte, &number, sizeof(number));
  }
};

TEST(AxesMemory, numbers_stand_where_the_byte_table_says) {
  Memory memory;
  store_axes(memory.command(), some_command(9));
  EXPECT_EQ(memory.at<std::uint64_t>(0), 9U);
  EXPECT_EQ(memory.at<std::uint32_t>(8), 1U);
  EXPECT_EQ(memory.at<std::uint32_t>(12), 3U);
  EXPECT_EQ(memory.at<std::int64_t>(16), 1'800'000'000'000'000'005);
  EXPECT_EQ(memory.at<std::int64_t>(24), -42);
  EXPECT_EQ(memory.at<std::uint32_t>(32), 1000U);
  EXPECT_EQ(memory.at<std::uint32_t>(36), 20U);
  EXPECT_EQ(memory.at<std::uint32_t>(40), 2U);
  EXPECT_EQ(memory.at<double>(48), 0.25);
  EXPECT_EQ(memory.at<double>(48 + 24), -2.0);
  EXPECT_EQ(memory.at<double>(48 + 24 + 16), -8.0);
  EXPECT_EQ(memory.at<std::uint64_t>(168), 9U);

  store_axes(memory.monitor(), some_monitor(4));
  EXPECT_EQ(memory.at<std::uint64_t>(256), 4U);
  EXPECT_EQ(memory.at<std::uint32_t>(256 + 8), 1U);
  EXPECT_EQ(memory.at<std::uint32_t>(256 + 12), 5U);
  EXPECT_EQ(memory.at<std::int64_t>(256 + 16), 17);
  EXPECT_EQ(memory.at<std::uint64_t>(256 + 24), 77U);
  EXPECT_EQ(memory.at<std::uint32_t>(256 + 32), 0b10001U);
  EXPECT_EQ(memory.at<std::uint32_t>(256 + 36), 0b00100U);
  EXPECT_EQ(memory.at<std::uint32_t>(256 + 40), 5U);
  EXPECT_EQ(memory.at<std::uint32_t>(256 + 44), 1U);
  EXPECT_EQ(memory.at<double>(256 + 48 + 4 * 24), 0.5);
  EXPECT_EQ(memory.at<double>(256 + 168 + 8), 40.0);
  EXPECT_EQ(memory.at<std::uint64_t>(256 + 288), 4U);
  EXPECT_EQ(kAxesMemoryBytes, 552U);
}

TEST(AxesMemory, a_message_is_read_once_and_comes_back_as_it_was) {
  Memory memory;
  std::uint64_t seen = 0;
  AxesCommand read;
  EXPECT_EQ(load_axes(memory.command(), seen, read).status, AxesLoadStatus::nothing);
  const std::uint64_t before = test::heap_request_count();
  store_axes(memory.command(), some_command(9));
  EXPECT_EQ(load_axes(memory.command(), seen, read).status, AxesLoadStatus::done);
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(seen, 9U);
  EXPECT_EQ(latest_counter(memory.command()), 9U);
  EXPECT_EQ(read.counter, 9U);
  EXPECT_EQ(read.mode, AxesMode::follow);
  EXPECT_EQ(read.timeout_ms, 20U);
  EXPECT_EQ(read.sim_time_ns, -42);
  ASSERT_EQ(read.count, 2U);
  EXPECT_EQ(read.axes[1].rate_rad_s, 0.5);
  EXPECT_EQ(load_axes(memory.command(), seen, read).status, AxesLoadStatus::nothing);

  seen = 0;
  AxesMonitor report;
  store_axes(memory.monitor(), some_monitor(3));
  EXPECT_EQ(load_axes(memory.monitor(), seen, report).status, AxesLoadStatus::done);
  EXPECT_EQ(report.state, AxesState::following);
  EXPECT_EQ(report.command_counter, 77U);
  EXPECT_EQ(report.faulty_axes, 0b00100U);
  EXPECT_TRUE(report.timed_out);
  EXPECT_EQ(report.demanded[4].angle_rad, 1.0);
  EXPECT_EQ(report.measured[4].acceleration_rad_s2, 15000.0);
  // A controller that was started anew counts from 1 again.
  store_axes(memory.monitor(), some_monitor(1));
  EXPECT_EQ(load_axes(memory.monitor(), seen, report).status, AxesLoadStatus::done);
}

TEST(AxesMemory, a_block_under_change_is_torn_and_read_again_later) {
  Memory memory;
  store_axes(memory.command(), some_command(9));
  memory.set<std::uint64_t>(0, 10);  // the writer has begun the next message
  std::uint64_t seen = 0;
  AxesCommand read;
  EXPECT_EQ(load_axes(memory.command(), seen, read).status, AxesLoadStatus::torn);
  EXPECT_EQ(seen, 0U);
  EXPECT_EQ(read.counter, 0U);
  store_axes(memory.command(), some_command(10));
  EXPECT_EQ(load_axes(memory.command(), seen, read).status, AxesLoadStatus::done);
  EXPECT_EQ(read.counter, 10U);
}

TEST(AxesMemory, what_the_codec_refuses_is_refused_here) {
  const auto fault_of = [](std::size_t byte, auto number) {
    Memory memory;
    store_axes(memory.command(), some_command(9));
    memory.set(byte, number);
    std::uint64_t seen = 0;
    AxesCommand read;
    const AxesLoad load = load_axes(memory.command(), seen, read);
    EXPECT_EQ(load.status, AxesLoadStatus::refused);
    EXPECT_EQ(seen, 9U) << "it is not looked at again";
    EXPECT_EQ(read.counter, 0U);
    return load.fault;
  };
  const double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault_of(8, std::uint32_t{2}), AxesFault::version);
  EXPECT_EQ(fault_of(12, std::uint32_t{0}), AxesFault::malformed);
  EXPECT_EQ(fault_of(12, std::uint32_t{4}), AxesFault::malformed);
  EXPECT_EQ(fault_of(12, std::uint32_t{256 + 3}), AxesFault::malformed);
  EXPECT_EQ(fault_of(40, std::uint32_t{6}), AxesFault::axes);
  EXPECT_EQ(fault_of(40, std::uint32_t{0}), AxesFault::axes);
  EXPECT_EQ(fault_of(36, std::uint32_t{0}), AxesFault::value);
  EXPECT_EQ(fault_of(36, std::uint32_t{60'001}), AxesFault::value);
  EXPECT_EQ(fault_of(16, std::int64_t{-1}), AxesFault::value);
  EXPECT_EQ(fault_of(48, kNan), AxesFault::value);
  EXPECT_EQ(fault_of(72, 1.1e6), AxesFault::value);
  EXPECT_EQ(fault_of(80, -1.1e5), AxesFault::value);
  EXPECT_EQ(fault_of(88, 1.1e8), AxesFault::value);

  Memory memory;
  AxesMonitor report;
  const auto monitor_fault = [&](std::size_t byte, auto number) {
    store_axes(memory.monitor(), some_monitor(9));
    memory.set(256 + byte, number);
    std::uint64_t seen = 0;
    return load_axes(memory.monitor(), seen, report).fault;
  };
  EXPECT_EQ(monitor_fault(12, std::uint32_t{7}), AxesFault::malformed);
  EXPECT_EQ(monitor_fault(12, std::uint32_t{0}), AxesFault::malformed);
  EXPECT_EQ(monitor_fault(40, std::uint32_t{6}), AxesFault::axes);
  EXPECT_EQ(monitor_fault(16, std::numeric_limits<std::int64_t>::max()), AxesFault::value);
  EXPECT_EQ(monitor_fault(168, kNan), AxesFault::value);
  EXPECT_EQ(monitor_fault(48 + 4 * 24, -1.1e6), AxesFault::value);
  // A number of an axis that is not in use may be anything.
  store_axes(memory.command(), some_command(9));
  memory.set(48 + 2 * 24, kNan);
  std::uint64_t seen = 0;
  AxesCommand read;
  EXPECT_EQ(load_axes(memory.command(), seen, read).status, AxesLoadStatus::done);
}

/// A writer changes all numbers at once. A reader beside it must never see two messages in one.
TEST(AxesMemory, a_reader_beside_a_writer_sees_whole_messages) {
  Memory memory;
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    AxesMonitor monitor = some_monitor(1);
    while (!stop.load(std::memory_order_relaxed)) {
      ++monitor.counter;
      monitor.command_counter = monitor.counter;
      const double value = static_cast<double>(monitor.counter % 1000);
      for (std::size_t i = 0; i < kMaxAxes; ++i) {
        monitor.measured[i] = monitor.demanded[i] = {value, value, value};
      }
      store_axes(memory.monitor(), monitor);
    }
  });
  std::uint64_t seen = 0;
  int read_count = 0;
  bool whole = true;
  for (int i = 0; i < 2'000'000 && read_count < 20'000; ++i) {
    AxesMonitor read;
    if (load_axes(memory.monitor(), seen, read).status != AxesLoadStatus::done) continue;
    ++read_count;
    const double value = static_cast<double>(read.counter % 1000);
    whole = whole && read.command_counter == read.counter;
    for (std::size_t k = 0; k < kMaxAxes; ++k) {
      whole = whole && read.measured[k].angle_rad == value && read.demanded[k].rate_rad_s == value;
    }
  }
  stop = true;
  writer.join();
  EXPECT_TRUE(whole);
  EXPECT_GT(read_count, 0);
}

}  // namespace
}  // namespace emit::protocol
