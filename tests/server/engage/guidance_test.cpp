// SPDX-License-Identifier: Apache-2.0
#include "engage/guidance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "engage/missile.hpp"

namespace emit::server {
namespace {

glm::dvec3 level(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad), 0.0};
}

TEST(LineOfSightFilter, FindsDirectionAndRateOfASteadyTurn) {
  LineOfSightFilter filter(0.8);
  EXPECT_FALSE(filter.ready());
  filter.update(0.0, std::nullopt);
  EXPECT_FALSE(filter.ready());
  for (int i = 1; i <= 100; ++i) filter.update(0.01 * i, level(0.05 * 0.01 * i));
  EXPECT_NEAR(filter.rate_rad_s().z, 0.05, 1e-7);
  EXPECT_NEAR(glm::length(filter.rate_rad_s()), 0.05, 1e-7);
  EXPECT_LT(glm::length(filter.direction_at(1.0) - level(0.05)), 1e-9);
  EXPECT_LT(glm::length(filter.direction_at(1.2) - level(0.06)), 1e-7);
}

TEST(LineOfSightFilter, HasTheGainsOfTheFadingMemoryFilter) {
  LineOfSightFilter filter(0.6);
  filter.update(0.0, level(0.0));
  filter.update(0.5, level(0.01));
  // G = 1 - 0.6^2, H = (1 - 0.6)^2.
  EXPECT_NEAR(std::asin(filter.direction_at(0.5).y), 0.64 * 0.01, 1e-12);
  EXPECT_NEAR(filter.rate_rad_s().z, 0.16 * 0.01 / 0.5, 1e-9);
}

TEST(LineOfSightFilter, TurnsOnWhileTheTargetIsLost) {
  LineOfSightFilter filter(0.5);
  for (int i = 0; i <= 50; ++i) filter.update(0.01 * i, level(0.1 * 0.01 * i));
  for (int i = 51; i <= 100; ++i) filter.update(0.01 * i, std::nullopt);
  EXPECT_LT(glm::length(filter.direction_at(1.0) - level(0.1)), 1e-6);
}

TEST(ProportionalNavigation, TurnsTheVelocityAfterTheLineOfSight) {
  const glm::dvec3 command =
      proportional_navigation_m_s2(3.0, {0.0, 0.0, 0.02}, {200.0, 0.0, 0.0}, 0.0);
  EXPECT_LT(glm::length(command - glm::dvec3(0.0, 12.0, 0.0)), 1e-12);
}

TEST(ProportionalNavigation, HoldsThePartOfGravityAcrossTheVelocity) {
  const glm::dvec3 v{0.0, 100.0, -100.0};
  const glm::dvec3 command = proportional_navigation_m_s2(3.0, glm::dvec3(0.0), v, 9.8);
  EXPECT_NEAR(glm::dot(command, v), 0.0, 1e-9);
  EXPECT_NEAR(glm::length(command), 9.8 * std::sqrt(0.5), 1e-9);
}

/// Zarchan, chapter 2: with a heading error e at the begin, time to go T and no lag, proportional
/// navigation against a target that keeps its course accelerates by
///   a(t) = N V e / T (1 - t/T)^(N - 2).
TEST(ProportionalNavigation, AcceleratesByTheClosedFormForAHeadingError) {
  constexpr double kSpeed = 300.0;
  constexpr double kRange = 3000.0;
  constexpr double kError = 0.01;
  for (const double gain : {3.0, 4.0, 5.0}) {
    MissileParameters parameters;
    parameters.drag_coefficient = 0.0;
    parameters.induced_drag_per_rad2 = 0.0;
    parameters.gravity_m_s2 = 0.0;
    parameters.autopilot_lag_s = 1e-3;
    MissileState launch;
    launch.velocity_m_s = kSpeed * level(kError);
    Missile missile(parameters, launch);
    const double total_s = kRange / kSpeed;
    const double first = gain * kSpeed * kError / total_s;
    ClosestApproach closest;
    for (int i = 0; !closest.passed(); ++i) {
      const glm::dvec3 r = glm::dvec3(kRange, 0.0, 0.0) - missile.state().position_m;
      const glm::dvec3 rate = glm::cross(r, -missile.state().velocity_m_s) / glm::dot(r, r);
      missile.step(proportional_navigation_m_s2(gain, rate, missile.state().velocity_m_s, 0.0),
                   1e-3);
      closest.add(missile.state().time_s, r);
      ASSERT_LT(i, 11000);
      if (i % 500 == 499 && i < 9500) {
        const double expected =
            first * std::pow(1.0 - missile.state().time_s / total_s, gain - 2.0);
        EXPECT_NEAR(-missile.state().lift_m_s2.y, expected, 0.01 * first) << gain << " " << i;
      }
    }
    EXPECT_LT(closest.distance_m(), 0.05);
  }
}

TEST(ClosestApproach, LiesBetweenTheSteps) {
  // The target passes 3 m aside; the nearest point lies at 1.25 s.
  ClosestApproach closest;
  for (const double t : {0.0, 1.0, 2.0}) {
    EXPECT_FALSE(closest.passed());
    closest.add(t, {400.0 * (1.25 - t), 3.0, 0.0});
  }
  EXPECT_NEAR(closest.distance_m(), 3.0, 1e-12);
  EXPECT_NEAR(closest.time_s(), 1.25, 1e-12);
  EXPECT_TRUE(closest.passed());
}

TEST(ClosestApproach, IsPassedWhenAStepEndsFartherAway) {
  ClosestApproach closest;
  closest.add(0.0, {10.0, 0.0, 0.0});
  closest.add(1.0, {5.0, 0.0, 0.0});
  EXPECT_FALSE(closest.passed());
  closest.add(2.0, {-6.0, 0.0, 0.0});
  EXPECT_TRUE(closest.passed());
  EXPECT_NEAR(closest.distance_m(), 0.0, 1e-12);
  EXPECT_NEAR(closest.time_s(), 1.0 + 5.0 / 11.0, 1e-12);
}

TEST(SeekerHead, FollowsWithALag) {
  SeekerHead head({.lag_s = 0.1, .max_rate_rad_s = 10.0, .max_look_rad = 1.0}, level(0.0));
  for (int i = 0; i < 100; ++i) head.step(level(0.1), level(0.0), 0.001);
  EXPECT_NEAR(std::atan2(head.axis().y, head.axis().x), 0.1 * (1.0 - std::exp(-1.0)), 1e-9);
}

TEST(SeekerHead, KeepsItsRateAndItsTravel) {
  SeekerHead head({.lag_s = 0.001, .max_rate_rad_s = 0.5, .max_look_rad = 0.3}, level(0.0));
  head.step(level(1.0), level(0.0), 0.1);
  EXPECT_NEAR(std::atan2(head.axis().y, head.axis().x), 0.05, 1e-9);
  EXPECT_FALSE(head.at_limit());
  for (int i = 0; i < 20; ++i) head.step(level(1.0), level(0.0), 0.1);
  EXPECT_NEAR(std::atan2(head.axis().y, head.axis().x), 0.3, 1e-9);
  EXPECT_TRUE(head.at_limit());
}

}  // namespace
}  // namespace emit::server
