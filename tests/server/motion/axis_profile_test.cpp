// SPDX-License-Identifier: Apache-2.0
#include "motion/axis_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace emit::server {
namespace {

constexpr double kStepS = 1e-3;
constexpr AxisLimits kLimits{-2.0, 1.5, 4.0, 60.0};

AxisProfile profile_of(const AxisLimits& limits = kLimits) {
  auto profile = AxisProfile::create(limits);
  EXPECT_TRUE(profile.has_value());
  return *profile;
}

/// Checks that a step led from one motion to the next within the limits.
void expect_within(const AxisMotion& from, const AxisMotion& to, const AxisLimits& limits,
                   double share = 1.0) {
  EXPECT_LE(std::abs(to.acceleration_rad_s2), share * limits.acceleration_rad_s2 * (1.0 + 1e-9));
  EXPECT_LE(std::abs(to.rate_rad_s), share * limits.rate_rad_s * (1.0 + 1e-9));
  EXPECT_LE(to.angle_rad, limits.max_rad);
  EXPECT_GE(to.angle_rad, limits.min_rad);
  EXPECT_NEAR(to.rate_rad_s, from.rate_rad_s + kStepS * to.acceleration_rad_s2, 1e-12);
  EXPECT_NEAR(to.angle_rad, from.angle_rad + 0.5 * kStepS * (from.rate_rad_s + to.rate_rad_s),
              1e-12);
}

TEST(AxisProfile, refuses_limits_without_travel_rate_or_acceleration) {
  for (const AxisLimits& limits :
       {AxisLimits{1.0, 1.0, 1.0, 1.0}, AxisLimits{0.0, 1.0, 0.0, 1.0},
        AxisLimits{0.0, 1.0, 1.0, -1.0}, AxisLimits{0.0, 1.0, NAN, 1.0},
        AxisLimits{0.0, 1.0, 1.0, std::numeric_limits<double>::infinity()}}) {
    EXPECT_FALSE(AxisProfile::create(limits).has_value());
  }
}

TEST(AxisProfile, never_leaves_its_limits_whatever_is_demanded) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> angle_rad(-4.0, 4.0);
  std::uniform_real_distribution<double> rate_rad_s(-12.0, 12.0);
  std::uniform_real_distribution<double> acceleration_rad_s2(-200.0, 200.0);
  std::uniform_int_distribution<int> steps(1, 400);
  AxisProfile profile = profile_of();
  profile.start(0.3);
  for (int demand = 0; demand < 2000; ++demand) {
    const AxisMotion wanted{angle_rad(random), rate_rad_s(random), acceleration_rad_s2(random)};
    for (int i = steps(random); i > 0; --i) {
      const AxisMotion before = profile.motion();
      expect_within(before, profile.step(wanted, kStepS).motion, kLimits);
      ASSERT_FALSE(testing::Test::HasFailure()) << demand;
    }
  }
}

TEST(AxisProfile, follows_what_the_axis_can_do_without_lag) {
  AxisProfile profile = profile_of();
  profile.start(0.0);
  // A sine of 1 Hz asks for 3.8 rad/s and 24 rad/s2.
  constexpr double kTurnRadS = 6.283185307179586;
  constexpr double kSizeRad = 0.6;
  for (int i = 1; i < 4000; ++i) {
    const double phase = kTurnRadS * kStepS * i;
    const AxisMotion wanted{kSizeRad * std::sin(phase), kSizeRad * kTurnRadS * std::cos(phase),
                            -kSizeRad * kTurnRadS * kTurnRadS * std::sin(phase)};
    const AxisProfile::Command command = profile.step(wanted, kStepS);
    if (i < 500) continue;  // it starts at rest and catches up
    EXPECT_FALSE(command.limited()) << i;
    EXPECT_NEAR(command.motion.angle_rad, wanted.angle_rad, 1e-7) << i;
    EXPECT_NEAR(command.motion.rate_rad_s, wanted.rate_rad_s, 1e-4) << i;
  }
}

TEST(AxisProfile, a_step_takes_little_longer_than_the_least_possible_time) {
  for (const double way_rad : {1e-4, 0.01, 0.2, 1.4}) {
    for (const double share : {1.0, 0.2}) {
      SCOPED_TRACE(testing::Message() << way_rad << " rad, share " << share);
      const double rate = share * kLimits.rate_rad_s;
      const double acceleration = share * kLimits.acceleration_rad_s2;
      const double least_s = way_rad < rate * rate / acceleration
                                 ? 2.0 * std::sqrt(way_rad / acceleration)
                                 : way_rad / rate + rate / acceleration;
      AxisProfile profile = profile_of();
      profile.start(0.0);
      double arrived_s = 0.0;
      for (int i = 1; i * kStepS < 3.0 * least_s + 0.1; ++i) {
        const AxisMotion before = profile.motion();
        const AxisMotion now = profile.step({way_rad, 0.0, 0.0}, kStepS, share).motion;
        expect_within(before, now, kLimits, share);
        EXPECT_LT(now.angle_rad, way_rad * (1.0 + 1e-3) + 1e-6) << "no overshoot";
        if (std::abs(now.angle_rad - way_rad) > 0.01 * way_rad) arrived_s = i * kStepS;
      }
      // The last hundredth is made up for by a quarter in each step.
      EXPECT_LT(arrived_s, 1.2 * least_s + 20.0 * kStepS);
      EXPECT_NEAR(profile.motion().angle_rad, way_rad, 1e-3 * way_rad);
    }
  }
}

TEST(AxisProfile, stays_inside_when_its_share_falls_near_an_end) {
  const AxisLimits limits{-2.1, 2.1, 7.0, 140.0};
  for (double from_rad = 1.7; from_rad < 2.1; from_rad += 0.01) {
    AxisProfile profile = profile_of(limits);
    profile.start(-2.0);
    while (profile.motion().angle_rad < from_rad && profile.motion().rate_rad_s >= 0.0) {
      profile.step({2.2, 7.0, 0.0}, kStepS);
      if (profile.motion().angle_rad > 2.0999) break;
    }
    for (int i = 0; i < 2000; ++i) {
      const AxisMotion before = profile.motion();
      expect_within(before, profile.step({0.0, 0.0, 0.0}, kStepS, 0.2).motion, limits);
    }
    EXPECT_NEAR(profile.motion().angle_rad, 0.0, 0.1);
    ASSERT_FALSE(testing::Test::HasFailure()) << from_rad;
  }
}

TEST(AxisProfile, a_travel_shorter_than_a_step_is_kept_too) {
  const AxisLimits limits{-0.01, 0.01, 7.0, 140.0};
  AxisProfile profile = profile_of(limits);
  profile.start(0.0);
  for (int i = 0; i < 200; ++i) {
    const AxisMotion now = profile.step({i % 20 < 10 ? 1.0 : -1.0, 0.0, 0.0}, 0.1).motion;
    EXPECT_LE(std::abs(now.angle_rad), 0.01);
  }
}

TEST(AxisProfile, says_which_limit_it_is_at) {
  AxisProfile profile = profile_of();
  profile.start(0.0);
  EXPECT_TRUE(profile.step({1.0, 0.0, 0.0}, kStepS).acceleration_limited);
  AxisProfile::Command command;
  for (int i = 0; i < 100; ++i) command = profile.step({1.0, 0.0, 0.0}, kStepS);
  EXPECT_TRUE(command.rate_limited);
  EXPECT_FALSE(command.travel_limited);
  for (int i = 0; i < 3000; ++i) command = profile.step({3.0, 2.0, 0.0}, kStepS);
  EXPECT_TRUE(command.travel_limited);
  EXPECT_FALSE(command.rate_limited || command.acceleration_limited);
  EXPECT_NEAR(command.motion.angle_rad, kLimits.max_rad, 1e-4);
  EXPECT_LE(command.motion.angle_rad, kLimits.max_rad);
  EXPECT_NEAR(command.motion.rate_rad_s, 0.0, 1e-6);
}

TEST(AxisProfile, an_axis_without_ends_turns_on) {
  AxisProfile profile = profile_of({.rate_rad_s = 4.0, .acceleration_rad_s2 = 60.0});
  profile.start(0.0);
  AxisProfile::Command command;
  for (int i = 1; i <= 20000; ++i) command = profile.step({3.0 * kStepS * i, 3.0, 0.0}, kStepS);
  EXPECT_NEAR(command.motion.angle_rad, 60.0, 1e-9);
  EXPECT_FALSE(command.limited());
}

}  // namespace
}  // namespace emit::server
