// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/axes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "emit/v1/axes.pb.h"
#include "support/heap_counter.hpp"

namespace emit::protocol {
namespace {

AxesCommand full_command() {
  AxesCommand out;
  out.counter = 77;
  out.time_ns = 1'800'000'000'000'000'005;
  out.sim_time_ns = -42;
  out.period_us = 1000;
  out.timeout_ms = 20;
  out.mode = AxesMode::follow;
  out.count = kMaxAxes;
  for (std::size_t i = 0; i < kMaxAxes; ++i) {
    const double k = static_cast<double>(i) + 1.0;
    out.axes[i] = {0.1 * k, -20.0 * k, 3000.0 * k};
  }
  return out;
}

AxesMonitor full_monitor() {
  AxesMonitor out;
  out.counter = 5;
  out.time_ns = 17;
  out.command_counter = 77;
  out.state = AxesState::following;
  out.limited_axes = 0b10001;
  out.faulty_axes = 0b00100;
  out.timed_out = true;
  out.count = 3;
  for (std::size_t i = 0; i < out.count; ++i) {
    const double k = static_cast<double>(i) + 1.0;
    out.measured[i] = {0.1 * k, -20.0 * k, 3000.0 * k};
    out.demanded[i] = {0.2 * k, 40.0 * k, -1.0 * k};
  }
  return out;
}

void expect_equal(const AxisMotion& a, const AxisMotion& b) {
  EXPECT_EQ(a.angle_rad, b.angle_rad);
  EXPECT_EQ(a.rate_rad_s, b.rate_rad_s);
  EXPECT_EQ(a.acceleration_rad_s2, b.acceleration_rad_s2);
}

template <class Message>
std::span<const std::byte> bytes_of(const Message& message, std::string& space) {
  space = message.SerializeAsString();
  return std::as_bytes(std::span(space));
}

/// Returns the bytes of a good command after a change of its message.
std::string changed(const std::function<void(v1::AxesCommand&)>& change) {
  AxesCodec codec;
  const auto bytes = codec.encode(full_command());
  v1::AxesCommand message;
  EXPECT_TRUE(message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  change(message);
  return message.SerializeAsString();
}

TEST(Axes, a_command_survives_the_wire) {
  AxesCodec codec;
  const AxesCommand in = full_command();
  const auto wire = codec.encode(in);
  const std::vector<std::byte> bytes(wire.begin(), wire.end());
  AxesCommand out;
  ASSERT_EQ(codec.decode(bytes, out), AxesFault::none);
  EXPECT_EQ(out.counter, in.counter);
  EXPECT_EQ(out.time_ns, in.time_ns);
  EXPECT_EQ(out.sim_time_ns, in.sim_time_ns);
  EXPECT_EQ(out.period_us, in.period_us);
  EXPECT_EQ(out.timeout_ms, in.timeout_ms);
  EXPECT_EQ(out.mode, in.mode);
  ASSERT_EQ(out.count, in.count);
  for (std::size_t i = 0; i < in.count; ++i) expect_equal(out.axes[i], in.axes[i]);
}

TEST(Axes, a_monitor_survives_the_wire) {
  AxesCodec codec;
  const AxesMonitor in = full_monitor();
  const auto wire = codec.encode(in);
  const std::vector<std::byte> bytes(wire.begin(), wire.end());
  AxesMonitor out;
  ASSERT_EQ(codec.decode(bytes, out), AxesFault::none);
  EXPECT_EQ(out.counter, in.counter);
  EXPECT_EQ(out.time_ns, in.time_ns);
  EXPECT_EQ(out.command_counter, in.command_counter);
  EXPECT_EQ(out.state, in.state);
  EXPECT_EQ(out.limited_axes, in.limited_axes);
  EXPECT_EQ(out.faulty_axes, in.faulty_axes);
  EXPECT_EQ(out.timed_out, in.timed_out);
  ASSERT_EQ(out.count, in.count);
  for (std::size_t i = 0; i < in.count; ++i) {
    expect_equal(out.measured[i], in.measured[i]);
    expect_equal(out.demanded[i], in.demanded[i]);
  }
}

TEST(Axes, what_is_refused_is_named_and_changes_nothing) {
  struct Case {
    std::string bytes;
    AxesFault fault;
  };
  const auto with_angle = [](double angle_rad) {
    return changed([=](auto& m) { m.mutable_axes(2)->set_angle_rad(angle_rad); });
  };
  const std::vector<Case> cases = {
      {"", AxesFault::version},
      {std::string(kMaxAxesBytes + 1, '\0'), AxesFault::size},
      {"\xff\xff", AxesFault::malformed},
      {changed([](auto& m) { m.set_protocol_version(2); }), AxesFault::version},
      {changed([](auto& m) { m.clear_mode(); }), AxesFault::malformed},
      {changed([](auto& m) { m.set_mode(static_cast<v1::AxesCommand::Mode>(9)); }),
       AxesFault::malformed},
      {changed([](auto& m) { m.add_axes(); }), AxesFault::axes},
      {changed([](auto& m) { m.clear_axes(); }), AxesFault::axes},
      {changed([](auto& m) { m.set_timeout_ms(0); }), AxesFault::value},
      {changed([](auto& m) { m.set_timeout_ms(60'001); }), AxesFault::value},
      {with_angle(std::nan("")), AxesFault::value},
      {with_angle(std::numeric_limits<double>::infinity()), AxesFault::value},
      {with_angle(-2e6), AxesFault::value},
      {changed([](auto& m) { m.mutable_axes(0)->set_rate_rad_s(1e6); }), AxesFault::value},
      {changed([](auto& m) { m.mutable_axes(0)->set_acceleration_rad_s2(-1e9); }),
       AxesFault::value}};
  AxesCodec codec;
  for (const Case& each : cases) {
    AxesCommand out;
    out.counter = 123;
    EXPECT_EQ(codec.decode(std::as_bytes(std::span(each.bytes)), out), each.fault)
        << to_string(each.fault);
    EXPECT_EQ(out.counter, 123U);
  }
  // A command without axes can switch off and park.
  AxesCommand out;
  const std::string park = changed([](auto& m) {
    m.clear_axes();
    m.set_mode(v1::AxesCommand::PARK);
  });
  EXPECT_EQ(codec.decode(std::as_bytes(std::span(park)), out), AxesFault::none);
}

TEST(Axes, a_monitor_needs_as_many_demands_as_measurements) {
  AxesCodec codec;
  const auto wire = codec.encode(full_monitor());
  v1::AxesMonitor message;
  ASSERT_TRUE(message.ParseFromArray(wire.data(), static_cast<int>(wire.size())));
  message.add_measured();
  std::string space;
  AxesMonitor out;
  EXPECT_EQ(codec.decode(bytes_of(message, space), out), AxesFault::axes);
  message.mutable_measured()->RemoveLast();
  message.set_state(v1::AxesMonitor::STATE_UNSPECIFIED);
  EXPECT_EQ(codec.decode(bytes_of(message, space), out), AxesFault::malformed);
}

TEST(Axes, instants_out_of_range_are_refused_in_both_messages) {
  AxesCodec codec;
  const auto verdicts = [&](std::int64_t time_ns) {
    AxesCommand command = full_command();
    command.time_ns = time_ns;
    const std::span<const std::byte> sent = codec.encode(command);
    const std::vector<std::byte> command_bytes(sent.begin(), sent.end());
    AxesMonitor monitor = full_monitor();
    monitor.time_ns = time_ns;
    const std::span<const std::byte> answered = codec.encode(monitor);
    const std::vector<std::byte> monitor_bytes(answered.begin(), answered.end());
    return std::pair(codec.decode(command_bytes, command), codec.decode(monitor_bytes, monitor));
  };
  using Verdicts = std::pair<AxesFault, AxesFault>;
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  for (const std::int64_t time_ns : {kLeast, std::int64_t{-1}, kMaxAxesTimeNs + 1, ~kLeast}) {
    EXPECT_EQ(verdicts(time_ns), Verdicts(AxesFault::value, AxesFault::value)) << time_ns;
  }
  for (const std::int64_t time_ns : {std::int64_t{0}, kMaxAxesTimeNs}) {
    EXPECT_EQ(verdicts(time_ns), Verdicts(AxesFault::none, AxesFault::none)) << time_ns;
  }
}

TEST(Axes, coding_takes_no_memory) {
  AxesCodec codec;
  AxesCommand command = full_command();
  AxesMonitor monitor = full_monitor();
  std::vector<std::byte> bytes(kMaxAxesBytes);
  const auto code = [&] {
    const auto wire = codec.encode(command);
    std::copy(wire.begin(), wire.end(), bytes.begin());
    EXPECT_EQ(codec.decode(std::span(bytes).first(wire.size()), command), AxesFault::none);
    const auto answer = codec.encode(monitor);
    std::copy(answer.begin(), answer.end(), bytes.begin());
    EXPECT_EQ(codec.decode(std::span(bytes).first(answer.size()), monitor), AxesFault::none);
  };
  code();
  const std::uint64_t before = test::heap_request_count();
  for (int i = 0; i < 100; ++i) code();
  EXPECT_EQ(test::heap_request_count(), before);
}

}  // namespace
}  // namespace emit::protocol
