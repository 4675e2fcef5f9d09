// SPDX-License-Identifier: Apache-2.0
#include "motion/table_simulator.hpp"
#include "support/times.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emit::server {
namespace {

using protocol::AxesMode;
using protocol::AxesMonitor;
using protocol::AxesState;

using test::kMs;
constexpr double kTurnRadS = 3.0;
constexpr double kSizeRad = 0.3;

/// A host that sends a command every millisecond, and the table that answers.
class TableSimulatorTest : public ::testing::Test {
 protected:
  TableSimulatorTest() {
    TableSimulator::Options options;
    TableSimulator::Axis axis;
    axis.dynamics.limits = {-2.0, 2.0, 7.0, 140.0};
    axis.dynamics.delay_s = 0.002;
    axis.park_rad = -0.2;
    options.axes.assign(5, axis);
    auto table = TableSimulator::create(options);
    EXPECT_TRUE(table.has_value());
    table_.emplace(std::move(*table));
  }
  static double angle_at(std::int64_t time_ns) {
    return kSizeRad * std::sin(kTurnRadS * 1e-9 * static_cast<double>(time_ns));
  }
  protocol::AxesCommand command(AxesMode mode) {
    const double phase = kTurnRadS * 1e-9 * static_cast<double>(now_ns_);
    protocol::AxesCommand out;
    out.counter = ++counter_;
    out.time_ns = now_ns_;
    out.timeout_ms = 10;
    out.mode = mode;
    out.count = 5;
    for (auto& axis : out.axes) {
      axis = {kSizeRad * std::sin(phase), kSizeRad * kTurnRadS * std::cos(phase),
              -kSizeRad * kTurnRadS * kTurnRadS * std::sin(phase)};
    }
    return out;
  }
  /// Runs for a time with a command before each step.
  const AxesMonitor& run(AxesMode mode, int steps) {
    const AxesMonitor* last = nullptr;
    for (int i = 0; i < steps; ++i) {
      EXPECT_TRUE(table_->take(command(mode), now_ns_));
      last = &step();
    }
    return *last;
  }
  const AxesMonitor& step() {
    now_ns_ += kMs;
    return table_->step(now_ns_);
  }

  std::optional<TableSimulator> table_;
  std::int64_t now_ns_ = 0;
  std::uint64_t counter_ = 0;
};

TEST_F(TableSimulatorTest, starts_softly_and_follows) {
  EXPECT_EQ(step().state, AxesState::motors_off);
  EXPECT_EQ(run(AxesMode::follow, 1).state, AxesState::capturing);
  const std::int64_t start_ns = now_ns_;
  const AxesMonitor* last = &run(AxesMode::follow, 1);
  int steps = 0;
  while (last->state == AxesState::capturing && ++steps < 5000) {
    // The share of the greatest rate grows from a fifth to one within three seconds.
    const double share = 0.2 + 0.8 * 1e-9 * static_cast<double>(now_ns_ - start_ns) / 3.0;
    EXPECT_LE(std::abs(last->demanded[0].rate_rad_s), share * 7.0 * 1.001);
    last = &run(AxesMode::follow, 1);
  }
  EXPECT_LT(steps, 2000);
  const AxesMonitor& monitor = run(AxesMode::follow, 500);
  EXPECT_EQ(monitor.state, AxesState::following);
  EXPECT_EQ(monitor.limited_axes, 0U);
  EXPECT_EQ(monitor.command_counter, counter_);
  ASSERT_EQ(monitor.count, 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    // Commands are exact; the axes lag by their delay of 2 ms.
    EXPECT_NEAR(monitor.demanded[i].angle_rad, angle_at(now_ns_), 1e-6);
    EXPECT_NEAR(monitor.measured[i].angle_rad, angle_at(now_ns_ - 2 * kMs), 2e-5);
  }
}

TEST_F(TableSimulatorTest, parks_when_the_host_is_silent_and_comes_back) {
  run(AxesMode::follow, 3000);
  // The latest command arrived a step before the latest step.
  for (int i = 0; i < 9; ++i) EXPECT_EQ(step().state, AxesState::following);
  EXPECT_EQ(step().state, AxesState::parking);
  EXPECT_TRUE(step().timed_out);
  int steps = 0;
  while (step().state != AxesState::parked && ++steps < 5000) {
  }
  EXPECT_LT(steps, 2000);
  EXPECT_NEAR(step().measured[0].angle_rad, -0.2, 1e-3);
  EXPECT_EQ(run(AxesMode::follow, 1).state, AxesState::capturing);
  const AxesMonitor& monitor = run(AxesMode::follow, 3000);
  EXPECT_EQ(monitor.state, AxesState::following);
  EXPECT_FALSE(monitor.timed_out);
}

TEST_F(TableSimulatorTest, parks_on_command) {
  run(AxesMode::follow, 3000);
  EXPECT_EQ(run(AxesMode::park, 1).state, AxesState::parking);
  const AxesMonitor& monitor = run(AxesMode::park, 3000);
  EXPECT_EQ(monitor.state, AxesState::parked);
  EXPECT_FALSE(monitor.timed_out);
}

TEST_F(TableSimulatorTest, an_axis_that_does_not_follow_opens_the_interlock) {
  run(AxesMode::follow, 3000);
  table_->set_fault(3, AxisFault::runaway);
  const AxesMonitor* monitor = &run(AxesMode::follow, 1);
  int steps = 0;
  while (monitor->state == AxesState::following && ++steps < 500) {
    monitor = &run(AxesMode::follow, 1);
  }
  EXPECT_LT(steps, 100);
  EXPECT_EQ(monitor->state, AxesState::fault);
  EXPECT_EQ(monitor->faulty_axes, 1U << 3U);
  // The other axes come to rest, and commands change nothing until the motors were off.
  table_->set_fault(3, AxisFault::none);
  monitor = &run(AxesMode::follow, 500);
  EXPECT_EQ(monitor->state, AxesState::fault);
  EXPECT_NEAR(monitor->measured[0].rate_rad_s, 0.0, 1e-3);
  EXPECT_EQ(run(AxesMode::off, 1).state, AxesState::motors_off);
  EXPECT_EQ(run(AxesMode::follow, 4000).state, AxesState::following);
  EXPECT_EQ(run(AxesMode::follow, 1).faulty_axes, 0U);
}

TEST_F(TableSimulatorTest, takes_each_command_once_and_in_order) {
  const protocol::AxesCommand first = command(AxesMode::follow);
  protocol::AxesCommand second = command(AxesMode::follow);
  EXPECT_TRUE(table_->take(second, 0));
  EXPECT_FALSE(table_->take(first, 0));
  EXPECT_FALSE(table_->take(second, 0));
  protocol::AxesCommand three = command(AxesMode::follow);
  three.count = 3;
  EXPECT_FALSE(table_->take(three, 0));
  EXPECT_EQ(step().command_counter, second.counter);
}

TEST_F(TableSimulatorTest, a_host_that_was_started_anew_is_taken_after_the_timeout) {
  run(AxesMode::follow, 100);
  counter_ = 0;
  EXPECT_FALSE(table_->take(command(AxesMode::follow), now_ns_));
  for (int i = 0; i < 20; ++i) step();
  EXPECT_TRUE(table_->take(command(AxesMode::off), now_ns_));
  EXPECT_EQ(step().state, AxesState::motors_off);
}

TEST_F(TableSimulatorTest, off_counts_also_between_two_steps) {
  run(AxesMode::follow, 3000);
  table_->set_fault(0, AxisFault::stuck);
  while (run(AxesMode::follow, 1).state != AxesState::fault) {
  }
  table_->set_fault(0, AxisFault::none);
  EXPECT_TRUE(table_->take(command(AxesMode::off), now_ns_));
  EXPECT_TRUE(table_->take(command(AxesMode::follow), now_ns_));
  EXPECT_EQ(step().state, AxesState::motors_off);
  EXPECT_EQ(run(AxesMode::follow, 1).state, AxesState::capturing);
}

TEST_F(TableSimulatorTest, without_power_a_runaway_axis_comes_to_rest) {
  run(AxesMode::follow, 3000);
  table_->set_fault(1, AxisFault::runaway);
  while (run(AxesMode::follow, 1).state != AxesState::fault) {
  }
  EXPECT_NEAR(run(AxesMode::follow, 1000).measured[1].rate_rad_s, 0.0, 1e-3);
}

TEST_F(TableSimulatorTest, parking_near_an_end_opens_no_interlock) {
  // The host drives all axes towards their end as fast as they go, and is silent then.
  for (double angle_rad = -1.9; angle_rad < 1.6;) {
    const bool waits = now_ns_ < 5000 * kMs;
    if (!waits) angle_rad += 0.007;
    protocol::AxesCommand fast = command(AxesMode::follow);
    for (auto& axis : fast.axes) axis = {angle_rad, waits ? 0.0 : 7.0, 0.0};
    EXPECT_TRUE(table_->take(fast, now_ns_));
    EXPECT_NE(step().state, AxesState::fault);
  }
  for (int i = 0; i < 6000; ++i) EXPECT_NE(step().state, AxesState::fault);
  EXPECT_EQ(step().state, AxesState::parked);
}

TEST(TableSimulator, refuses_no_axes_and_axes_that_are_none) {
  EXPECT_FALSE(TableSimulator::create({}).has_value());
  TableSimulator::Options options;
  options.axes.resize(6);
  EXPECT_FALSE(TableSimulator::create(options).has_value());
  options.axes.resize(1);
  options.axes[0].dynamics.damping = 0.0;
  EXPECT_FALSE(TableSimulator::create(options).has_value());
  options.axes[0].dynamics.damping = 0.7;
  EXPECT_TRUE(TableSimulator::create(options).has_value());
  options.axes[0].dynamics.limits.max_rad = 1.0;
  options.axes[0].park_rad = 1.1;
  EXPECT_FALSE(TableSimulator::create(options).has_value());
}

}  // namespace
}  // namespace emit::server
