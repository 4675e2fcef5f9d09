// SPDX-License-Identifier: Apache-2.0
#include "motion/table_follower.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <optional>

#include "motion/table_simulator.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using protocol::AxesMode;
using protocol::AxesState;
using protocol::MotionState;

using test::kMs;

/// A host at 100 Hz whose seeker swings, the follower, and a table that answers every millisecond.
class TableFollowerTest : public ::testing::Test {
 protected:
  TableFollowerTest() {
    const auto unit =
        ThreeAxisGimbal::create({GimbalAxis::yaw, GimbalAxis::pitch, GimbalAxis::roll});
    const AxisLimits limits{-2.0, 2.0, 7.0, 140.0};
    TableFollower::Options options(
        MotionTable(*unit, TwoAxisGimbal(TwoAxisGimbal::Outer::azimuth), {}));
    options.axes.assign(5, {limits, 0.1});
    auto follower = TableFollower::create(options);
    EXPECT_TRUE(follower.has_value());
    follower_.emplace(std::move(*follower));
    TableSimulator::Options simulated;
    TableSimulator::Axis axis;
    axis.dynamics.limits = limits;
    axis.dynamics.natural_rad_s = 200.0;
    axis.park_rad = 0.1;
    simulated.axes.assign(5, axis);
    auto table = TableSimulator::create(simulated);
    EXPECT_TRUE(table.has_value());
    table_.emplace(std::move(*table));
    follower_->reset(now_ns_);
  }

  [[nodiscard]] SeekerPose pose() const {
    const double t = 1e-9 * static_cast<double>(now_ns_ - start_ns_);
    SeekerPose out;
    out.sim_time_ns = now_ns_ - start_ns_;
    out.seeker.world_from_body = physics::world_from_body_heading_pitch_roll(
        swing_rad_ * std::sin(2.0 * t), 0.2 * std::sin(1.3 * t), 0.5 * std::sin(t));
    out.target_m = {300.0 * std::sin(0.3 * t), 1000.0, 50.0};
    return out;
  }
  /// Runs for a time in steps of a millisecond.
  void run(std::int64_t for_ns) {
    for (std::int64_t end_ns = now_ns_ + for_ns; now_ns_ < end_ns;) {
      now_ns_ += kMs;
      if (host_speaks_ && now_ns_ % (10 * kMs) == 0) follower_->take(pose(), now_ns_);
      const protocol::AxesMonitor& monitor = table_->step(now_ns_);
      if (controller_answers_) static_cast<void>(follower_->take(monitor, now_ns_));
      const protocol::AxesCommand& command = follower_->step(now_ns_);
      EXPECT_TRUE(table_->take(command, now_ns_));
      mode_ = command.mode;
      if (command.mode == AxesMode::follow) note(command);
    }
  }
  void note(const protocol::AxesCommand& command) {
    for (std::size_t i = 0; i < 5; ++i) {
      const AxisMotion& axis = command.axes[i];
      if (noted_ && command.counter == last_.counter + 1) {
        const double jump = axis.angle_rad - last_.axes[i].angle_rad -
                            0.5e-3 * (axis.rate_rad_s + last_.axes[i].rate_rad_s);
        largest_jump_rad_ = std::max(largest_jump_rad_, std::abs(jump));
        largest_kick_rad_s2_ = std::max(
            largest_kick_rad_s2_, std::abs(axis.rate_rad_s - last_.axes[i].rate_rad_s) / 1e-3);
      }
    }
    last_ = command;
    noted_ = true;
  }

  std::optional<TableFollower> follower_;
  std::optional<TableSimulator> table_;
  const std::int64_t start_ns_ = 1'700'000'000'000 * kMs;
  std::int64_t now_ns_ = start_ns_;
  double swing_rad_ = 0.4;
  bool host_speaks_ = true;
  bool controller_answers_ = true;
  AxesMode mode_ = AxesMode::off;
  protocol::AxesCommand last_;
  bool noted_ = false;
  double largest_jump_rad_ = 0.0;
  double largest_kick_rad_s2_ = 0.0;
};

TEST_F(TableFollowerTest, sets_off_softly_and_follows_without_a_jump) {
  run(50 * kMs);
  EXPECT_EQ(mode_, AxesMode::off) << "the motors are off first, which closes an interlock";
  run(10'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
  EXPECT_EQ(follower_->status().faults, 0);
  largest_kick_rad_s2_ = 0.0;
  largest_jump_rad_ = 0.0;
  double worst_rad = 0.0;
  for (int i = 0; i < 5'000; ++i) {
    run(kMs);
    EXPECT_EQ(follower_->status().faults, 0);
    worst_rad = std::max(worst_rad, follower_->error_rad());
  }
  // The swing itself asks for 1.6 rad/s2. New poses at 100 Hz add little.
  EXPECT_LT(largest_kick_rad_s2_, 3.0);
  EXPECT_LT(largest_jump_rad_, 1e-8);
  EXPECT_LT(worst_rad, 1e-3);
  EXPECT_GT(worst_rad, 0.0);
}

TEST_F(TableFollowerTest, commands_that_were_left_out_bring_no_limit_and_no_jump) {
  run(10'000 * kMs);
  for (int gap = 0; gap < 20; ++gap) {
    run(100 * kMs);
    // The follower does not come to its turn for seven milliseconds.
    for (int i = 0; i < 7; ++i) {
      now_ns_ += kMs;
      static_cast<void>(follower_->take(table_->step(now_ns_), now_ns_));
    }
    run(kMs);
    EXPECT_EQ(follower_->status().faults, 0);
    EXPECT_LT(follower_->error_rad(), 1e-3);
  }
}

TEST_F(TableFollowerTest, parks_when_the_host_is_silent_and_follows_again) {
  run(10'000 * kMs);
  host_speaks_ = false;
  run(199 * kMs);
  EXPECT_EQ(follower_->status().faults, 0);
  run(12 * kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  EXPECT_EQ(follower_->status().faults, protocol::kMotionNoHost);
  EXPECT_EQ(follower_->status().state, MotionState::parking);
  run(20'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::parked);
  host_speaks_ = true;
  run(10'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
}

TEST_F(TableFollowerTest, parks_when_the_measurements_stop) {
  run(10'000 * kMs);
  controller_answers_ = false;
  run(22 * kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  EXPECT_EQ(follower_->status().faults, protocol::kMotionNoFeedback);
  EXPECT_EQ(follower_->status().state, MotionState::waiting);
  controller_answers_ = true;
  run(kMs);
  EXPECT_EQ(follower_->status().state, MotionState::capturing);
  run(10'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
}

TEST_F(TableFollowerTest, an_open_interlock_stays_until_the_run_is_reset) {
  run(10'000 * kMs);
  table_->set_fault(1, AxisFault::runaway);
  run(2'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::fault);
  EXPECT_NE(follower_->status().faults & protocol::kMotionInterlock, 0);
  table_->set_fault(1, AxisFault::none);
  run(2'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::fault) << "nothing closes it by itself";
  follower_->reset(now_ns_);
  run(20'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
}

TEST_F(TableFollowerTest, a_swing_beyond_the_travel_is_a_limit_and_stays_within_it) {
  swing_rad_ = 2.5;
  bool limited = false;
  for (int i = 0; i < 20'000; ++i) {
    run(kMs);
    limited = limited || (follower_->status().faults & protocol::kMotionLimit) != 0;
    for (const AxisMotion& axis : last_.axes) EXPECT_LE(std::abs(axis.angle_rad), 2.0 + 1e-12);
  }
  EXPECT_TRUE(limited);
}

TEST_F(TableFollowerTest, a_jump_of_simulation_time_is_flagged_and_followed) {
  run(10'000 * kMs);
  SeekerPose jumped = pose();
  jumped.sim_time_ns += 5'000 * kMs;
  EXPECT_FALSE(follower_->take(jumped, now_ns_));
  host_speaks_ = false;
  run(2 * kMs);
  EXPECT_EQ(follower_->status().faults & protocol::kMotionClock, protocol::kMotionClock);
}

TEST_F(TableFollowerTest, refuses_measurements_of_another_table_or_of_before) {
  run(10 * kMs);
  protocol::AxesMonitor monitor;
  monitor.count = 3;
  monitor.time_ns = now_ns_ + kMs;
  EXPECT_FALSE(follower_->take(monitor, now_ns_).has_value());
  monitor.count = 5;
  EXPECT_TRUE(follower_->take(monitor, now_ns_).has_value());
  EXPECT_FALSE(follower_->take(monitor, now_ns_).has_value());
}

TEST(TableFollower, refuses_axes_that_fit_no_table) {
  const auto unit = ThreeAxisGimbal::create({GimbalAxis::yaw, GimbalAxis::pitch, GimbalAxis::roll});
  TableFollower::Options options(MotionTable(*unit, std::nullopt, {}));
  EXPECT_FALSE(TableFollower::create(options).has_value());
  options.axes.assign(3, {{-1.0, 1.0, 1.0, 1.0}, 2.0});
  EXPECT_FALSE(TableFollower::create(options).has_value()) << "parks outside of the travel";
  options.axes.assign(3, {{-1.0, 1.0, 1.0, 1.0}, 0.0});
  EXPECT_TRUE(TableFollower::create(options).has_value());
  options.period_ns = 0;
  EXPECT_FALSE(TableFollower::create(options).has_value());
}

}  // namespace
}  // namespace emit::server
