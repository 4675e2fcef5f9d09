// SPDX-License-Identifier: Apache-2.0
#include "motion/axis_blend.hpp"

#include <gtest/gtest.h>

namespace emit::server {
namespace {

TEST(AxisBlend, begins_with_the_difference_and_ends_with_nothing) {
  AxisBlend blend;
  EXPECT_EQ(blend.at(0.0).angle_rad, 0.0);
  blend.start({0.3, -2.0, 40.0}, 0.02);
  const AxisMotion first = blend.at(0.0);
  EXPECT_DOUBLE_EQ(first.angle_rad, 0.3);
  EXPECT_DOUBLE_EQ(first.rate_rad_s, -2.0);
  EXPECT_DOUBLE_EQ(first.acceleration_rad_s2, 40.0);
  const AxisMotion last = blend.at(0.02 * (1.0 - 1e-9));
  EXPECT_NEAR(last.angle_rad, 0.0, 1e-12);
  EXPECT_NEAR(last.rate_rad_s, 0.0, 1e-6);
  EXPECT_NEAR(last.acceleration_rad_s2, 0.0, 1e-4);
  EXPECT_EQ(blend.at(0.02).angle_rad, 0.0);
  EXPECT_EQ(blend.at(5.0).rate_rad_s, 0.0);
}

TEST(AxisBlend, rate_and_acceleration_are_derivatives_of_the_angle) {
  AxisBlend blend;
  blend.start({0.3, -2.0, 40.0}, 0.02);
  constexpr double kStepS = 1e-6;
  for (double at_s = 1e-3; at_s < 0.019; at_s += 1e-3) {
    const double before = blend.at(at_s - kStepS).angle_rad;
    const double after = blend.at(at_s + kStepS).angle_rad;
    const AxisMotion now = blend.at(at_s);
    EXPECT_NEAR((after - before) / (2.0 * kStepS), now.rate_rad_s, 1e-5);
    EXPECT_NEAR((after - 2.0 * now.angle_rad + before) / (kStepS * kStepS), now.acceleration_rad_s2,
                0.5);
  }
}

TEST(AxisBlend, is_gone_after_clear) {
  AxisBlend blend;
  blend.start({0.3, 0.0, 0.0}, 1.0);
  blend.clear();
  EXPECT_EQ(blend.at(0.0).angle_rad, 0.0);
}

}  // namespace
}  // namespace emit::server
