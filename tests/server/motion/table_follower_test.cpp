// SPDX-License-Identifier: Apache-2.0
#include "motion/table_follower.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <utility>

#include "motion/table_simulator.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using protocol::AxesMode;
using protocol::MotionState;
using test::kMs;

/// A swing of the seeker has rates below this. A soft start begins with a fifth of 7 rad/s.
constexpr double kSwingRadS = 1.0;
constexpr double kSoftRadS = 0.2 * 7.0;
constexpr double kMostRadS2 = 140.0;

/// A host at 100 Hz whose seeker swings, the follower, and a table that answers every millisecond.
class TableFollowerTest : public ::testing::Test {
 protected:
  TableFollowerTest() {
    const auto unit =
        ThreeAxisGimbal::create({GimbalAxis::yaw, GimbalAxis::pitch, GimbalAxis::roll});
    const AxisLimits limits{-2.0, 2.0, 7.0, kMostRadS2};
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
  }

  [[nodiscard]] std::int64_t sim_ns() const { return now_ns_ - start_ns_ - paused_ns_; }
  [[nodiscard]] SeekerPose pose() const {
    const double t = 1e-9 * static_cast<double>(sim_ns());
    SeekerPose out;
    out.sim_time_ns = sim_ns();
    out.seeker.world_from_body = physics::world_from_body_heading_pitch_roll(
        turning_ ? 0.5 * t : swing_rad_ * std::sin(2.0 * t), 0.2 * std::sin(1.3 * t),
        0.5 * std::sin(t));
    return out;
  }
  void speak() {
    const double t = 1e-9 * static_cast<double>(sim_ns());
    if (speaks_of_target_) {
      follower_->take(
          TimedPoint{sim_ns(), {300.0 * std::sin(0.3 * t), 1000.0, 50.0}, std::nullopt, false});
    }
    static_cast<void>(follower_->take(pose(), now_ns_));
  }
  /// Runs for a time in steps of a millisecond.
  void run(std::int64_t for_ns) {
    for (std::int64_t end_ns = now_ns_ + for_ns; now_ns_ < end_ns;) {
      now_ns_ += kMs;
      if (host_speaks_ && now_ns_ % interval_ns_ == 0) speak();
      protocol::AxesMonitor monitor = table_->step(now_ns_);
      monitor.time_ns += controller_offset_ns_;
      measured_ = monitor.measured;

      if (controller_answers_) static_cast<void>(follower_->take(monitor, now_ns_));
      const protocol::AxesCommand& command = follower_->step(now_ns_);
      // After its clock was set, a controller takes none until the latest one is old.
      if (!deaf_) static_cast<void>(table_->take(command, now_ns_));
      mode_ = command.mode;
      if (command.mode == AxesMode::follow) note(command);
    }
  }

  /// Largest values of commands to follow since the last take_extremes().
  struct Extremes {
    double rate_rad_s = 0.0;
    double acceleration_rad_s2 = 0.0;
    double jump_rad = 0.0;  ///< of an angle against its rate
  };
  Extremes take_extremes() { return std::exchange(extremes_, {}); }
  void note(const protocol::AxesCommand& command) {
    const bool next = command.time_ns == last_.time_ns + kMs;
    for (std::size_t i = 0; i < 5; ++i) {
      const AxisMotion& axis = command.axes[i];
      const AxisMotion& before = last_.axes[i];
      const auto raise = [](double& largest, double value) {
        largest = std::max(largest, std::abs(value));
      };
      raise(extremes_.rate_rad_s, axis.rate_rad_s);
      if (!next) continue;
      raise(extremes_.acceleration_rad_s2, (axis.rate_rad_s - before.rate_rad_s) / 1e-3);
      raise(extremes_.jump_rad,
            axis.angle_rad - before.angle_rad - 0.5e-3 * (axis.rate_rad_s + before.rate_rad_s));
    }
    last_ = command;
  }
  /// Runs until the axes follow, and forgets what they did for it.
  void set_off() {
    run(10'000 * kMs);
    ASSERT_EQ(follower_->status().state, MotionState::following);
    ASSERT_EQ(follower_->status().faults, 0);
    take_extremes();
  }
  /// Says whether an axis is at a limit while the axes set off for a host whose first pose is that
  /// of 0.5 s, where the heading is 0.84 of the swing.
  bool is_limited_at_first() {
    host_speaks_ = false;
    run(500 * kMs);
    host_speaks_ = true;
    bool limited = false;
    for (int i = 0; i < 100; ++i) {
      run(kMs);
      limited = limited || (follower_->status().state == MotionState::capturing &&
                            (follower_->status().faults & protocol::kMotionLimit) != 0);
    }
    return limited;
  }
  void expect_soft(const Extremes& extremes, std::int64_t what) const {
    EXPECT_LT(extremes.rate_rad_s, kSoftRadS + kSwingRadS) << what;
    EXPECT_LT(extremes.acceleration_rad_s2, 1.01 * kMostRadS2) << what;
    EXPECT_LT(extremes.jump_rad, 1e-8) << what;
  }

  std::optional<TableFollower> follower_;
  std::optional<TableSimulator> table_;
  const std::int64_t start_ns_ = 1'700'000'000'000 * kMs;
  std::int64_t now_ns_ = start_ns_;
  std::int64_t paused_ns_ = 0;  ///< time that did not pass in the simulation
  double swing_rad_ = 0.4;
  bool turning_ = false;  ///< the seeker turns round and round
  bool host_speaks_ = true;
  bool speaks_of_target_ = true;
  bool controller_answers_ = true;
  std::int64_t controller_offset_ns_ = 0;
  bool deaf_ = false;                    ///< the controller takes no command
  std::int64_t interval_ns_ = 10 * kMs;  ///< between two poses
  std::array<AxisMotion, protocol::kMaxAxes> measured_{};
  AxesMode mode_ = AxesMode::off;

  protocol::AxesCommand last_;
  Extremes extremes_;
};

TEST_F(TableFollowerTest, sets_off_softly_and_follows_without_a_jump) {
  run(10'000 * kMs);
  expect_soft(take_extremes(), 0);
  EXPECT_EQ(follower_->status().state, MotionState::following);
  double worst_rad = 0.0;
  for (int i = 0; i < 5'000; ++i) {
    run(kMs);
    EXPECT_EQ(follower_->status().faults, 0);
    worst_rad = std::max(worst_rad, follower_->error_rad());
  }
  // The swing itself asks for 1.6 rad/s2. New poses at 100 Hz add little.
  const Extremes extremes = take_extremes();
  EXPECT_LT(extremes.acceleration_rad_s2, 3.0);
  EXPECT_LT(extremes.jump_rad, 1e-8);
  EXPECT_LT(worst_rad, 1e-3);
  EXPECT_GT(worst_rad, 0.0);
}

TEST_F(TableFollowerTest, poses_that_come_seldom_give_the_axes_no_kick) {
  interval_ns_ = 40 * kMs;
  set_off();
  run(5'000 * kMs);
  EXPECT_LT(take_extremes().acceleration_rad_s2, 3.0) << "the swing itself asks for 1.6 rad/s2";
}

TEST_F(TableFollowerTest, commands_that_were_left_out_bring_no_limit_and_no_jump) {
  set_off();
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
  set_off();
  host_speaks_ = false;
  run(212 * kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  EXPECT_EQ(follower_->status().faults, protocol::kMotionNoHost);
  EXPECT_EQ(follower_->status().state, MotionState::parking);
  run(20'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::parked);
  take_extremes();
  host_speaks_ = true;
  run(10'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
  expect_soft(take_extremes(), 0);
}

TEST_F(TableFollowerTest, a_host_that_falls_silent_leaves_the_axes_at_the_horizon) {
  set_off();
  host_speaks_ = false;
  const double before_rad = last_.axes[0].angle_rad;
  run(190 * kMs);
  EXPECT_EQ(mode_, AxesMode::follow);
  EXPECT_EQ(follower_->status().faults & protocol::kMotionNoHost, protocol::kMotionNoHost)
      << "frames say so at once";
  EXPECT_LT(std::abs(last_.axes[0].angle_rad - before_rad), 0.07) << "60 ms at 0.8 rad/s";
  EXPECT_LT(std::abs(last_.axes[0].rate_rad_s), 1e-3) << "the axes rest";
}

TEST_F(TableFollowerTest, a_host_that_paused_or_jumped_is_followed_softly) {
  // Simulation time stands for a while, jumps on or jumps back, and then it passes again.
  for (const std::int64_t pause_ns : {60 * kMs, 150 * kMs, 5'000 * kMs, -3'000 * kMs}) {
    set_off();
    host_speaks_ = pause_ns < 0;
    run(std::max<std::int64_t>(pause_ns, 0));
    host_speaks_ = true;
    paused_ns_ += pause_ns;
    bool flagged = false;
    for (int i = 0; i < 1'000; ++i) {
      run(kMs);
      flagged = flagged || follower_->status().faults != 0;
    }
    expect_soft(take_extremes(), pause_ns);
    EXPECT_TRUE(flagged) << pause_ns;
  }
}

TEST_F(TableFollowerTest, a_host_that_sends_the_same_instant_again_holds_the_axes) {
  set_off();
  const auto hold = [&](int ms) {
    for (int i = 0; i < ms; ++i) {
      paused_ns_ += kMs;
      run(kMs);
    }
  };
  hold(1'000);
  const protocol::AxesCommand held = last_;
  hold(2'000);
  for (std::size_t axis = 0; axis < 5; ++axis) {
    EXPECT_NEAR(last_.axes[axis].angle_rad, held.axes[axis].angle_rad, 1e-4);
  }
  expect_soft(take_extremes(), 0);
}

TEST_F(TableFollowerTest, a_wall_clock_that_is_set_makes_nothing_jump) {
  for (const std::int64_t step_ns : {37'000 * kMs, -37'000 * kMs, 2'000 * kMs, -50 * kMs}) {
    set_off();
    now_ns_ += step_ns;  // of this machine and of the controller's
    paused_ns_ += step_ns;
    run(3'000 * kMs);
    expect_soft(take_extremes(), step_ns);
  }
  set_off();
}

TEST_F(TableFollowerTest, parks_when_the_measurements_stop) {
  set_off();
  controller_answers_ = false;
  run(22 * kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  EXPECT_EQ(follower_->status().faults, protocol::kMotionNoFeedback);
  EXPECT_EQ(follower_->status().state, MotionState::waiting);
  // The axes went on at their rate. Commands go on from there, without a kick.
  controller_answers_ = true;
  run(kMs);
  EXPECT_EQ(follower_->status().state, MotionState::capturing);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_GT(std::abs(measured_[i].rate_rad_s), 0.05) << "the axes still move";
    EXPECT_NEAR(last_.axes[i].rate_rad_s, measured_[i].rate_rad_s, 1.01e-3 * kMostRadS2);
  }
  run(300 * kMs);

  expect_soft(take_extremes(), 0);
  set_off();
}

TEST_F(TableFollowerTest, an_open_interlock_stays_until_a_reset) {
  set_off();
  table_->set_fault(1, AxisFault::runaway);
  run(2'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::fault);
  EXPECT_NE(follower_->status().faults & protocol::kMotionInterlock, 0);
  table_->set_fault(1, AxisFault::none);
  run(2'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::fault) << "nothing closes it by itself";
  follower_->forget();
  run(2'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::fault) << "not even a new run";
  follower_->reset(now_ns_);
  run(50 * kMs);
  EXPECT_EQ(mode_, AxesMode::off);
  run(20'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
}

TEST_F(TableFollowerTest, a_new_run_parks_the_axes_until_its_first_pose) {
  set_off();
  host_speaks_ = false;
  follower_->forget();
  run(kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  host_speaks_ = true;
  run(5'000 * kMs);
  EXPECT_EQ(follower_->status().state, MotionState::following);
  expect_soft(take_extremes(), 0);
}

TEST_F(TableFollowerTest, a_controller_with_another_clock_is_not_followed) {
  controller_offset_ns_ = -37'000 * kMs;
  run(5'000 * kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  EXPECT_EQ(follower_->status().faults, protocol::kMotionControllerClock);
}

TEST_F(TableFollowerTest, a_controller_that_takes_no_command_is_flagged) {
  set_off();
  deaf_ = true;
  run(90 * kMs);
  EXPECT_EQ(follower_->status().faults & protocol::kMotionIgnored, 0);
  run(1'000 * kMs);
  EXPECT_NE(follower_->status().faults & protocol::kMotionIgnored, 0);
  deaf_ = false;
  set_off();
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

TEST_F(TableFollowerTest, a_demand_within_the_travel_is_no_limit_before_the_axes_follow) {
  swing_rad_ = 0.5;
  EXPECT_FALSE(is_limited_at_first());
}

TEST_F(TableFollowerTest, a_demand_beyond_the_travel_is_a_limit_before_the_axes_follow) {
  swing_rad_ = 3.0;
  EXPECT_TRUE(is_limited_at_first()) << "they would capture it without an end and a reason";
}

TEST_F(TableFollowerTest, a_full_circle_beyond_the_travel_comes_back_softly_at_its_other_end) {
  set_off();
  turning_ = true;
  bool at_one_end = false;
  bool came_back = false;
  for (int i = 0; i < 30'000; ++i) {
    run(kMs);
    at_one_end = at_one_end || last_.axes[0].angle_rad > 1.9;
    came_back = came_back || (at_one_end && last_.axes[0].angle_rad < 0.5);
  }
  EXPECT_LT(take_extremes().jump_rad, 1e-8);
  EXPECT_TRUE(came_back) << "a ring of limited travel must not rest at its end for ever";
}

TEST_F(TableFollowerTest, a_pose_that_is_no_number_does_not_stay_in_the_commands) {
  set_off();
  SeekerPose broken = pose();
  broken.sim_time_ns += kMs;
  broken.seeker.world_from_body.x = std::nan("");
  static_cast<void>(follower_->take(broken, now_ns_));
  for (int i = 0; i < 9; ++i) {
    run(kMs);
    for (const AxisMotion& axis : last_.axes) EXPECT_TRUE(std::isfinite(axis.angle_rad));
  }
  set_off();
}

TEST_F(TableFollowerTest, target_rings_wait_for_a_target) {
  speaks_of_target_ = false;
  run(2'000 * kMs);
  EXPECT_EQ(mode_, AxesMode::park);
  EXPECT_EQ(follower_->status().faults, protocol::kMotionNoHost);
  speaks_of_target_ = true;
  set_off();
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

TEST_F(TableFollowerTest, counts_commands_above_those_of_an_earlier_process) {
  run(10 * kMs);
  const std::uint64_t before = follower_->step(now_ns_).counter;
  // A gap in the numbers is a command that got lost.
  const std::uint64_t earlier = follower_->step(now_ns_ + 50 * kMs).counter;
  EXPECT_EQ(earlier, before + 1);
  const auto unit = ThreeAxisGimbal::create({GimbalAxis::yaw, GimbalAxis::pitch, GimbalAxis::roll});
  TableFollower::Options options(MotionTable(*unit, std::nullopt, {}));
  options.axes.assign(3, {{-1.0, 1.0, 1.0, 1.0}, 0.0});
  auto anew = TableFollower::create(options);
  ASSERT_TRUE(anew.has_value());
  EXPECT_GT(anew->step(now_ns_ + kMs).counter, earlier);
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
