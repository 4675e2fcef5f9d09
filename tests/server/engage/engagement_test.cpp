// SPDX-License-Identifier: Apache-2.0
#include "engage/engagement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <vector>

namespace emit::server {
namespace {

constexpr double kPeriodS = 0.01;

MissileState launch() {
  MissileState out;
  out.position_m = {-400.0, -2400.0, 700.0};
  // 8 degrees off the way to the target.
  out.velocity_m_s = 260.0 * glm::normalize(glm::dvec3(0.03, 0.97, -0.2));
  return out;
}

glm::dvec3 target_at(double time_s) {
  return {10.0 * time_s, 5.0, 1.5};
}

/// Flies with a seeker that measures the true direction in every frame, `delay` frames late.
std::vector<glm::dvec3> fly(Engagement& engagement, std::size_t delay = 0) {
  std::vector<glm::dvec3> path;
  std::vector<std::pair<double, glm::dvec3>> measured;
  while (!engagement.finished() && path.size() < 3000) {
    const double now_s = engagement.missile().state().time_s;
    measured.emplace_back(
        now_s, glm::normalize(target_at(now_s) - engagement.missile().state().position_m));
    if (measured.size() > delay) {
      const auto& [time_s, direction] = measured[measured.size() - 1 - delay];
      engagement.measure(time_s, direction);
    }
    engagement.advance(kPeriodS);
    path.push_back(engagement.missile().state().position_m);
  }
  return path;
}

TEST(Engagement, HitsATargetThatKeepsItsCourse) {
  Engagement engagement({}, launch(), target_at);
  const auto path = fly(engagement);
  EXPECT_TRUE(engagement.finished());
  EXPECT_FALSE(engagement.on_ground());
  EXPECT_LT(engagement.closest().distance_m(), 0.1);
  EXPECT_NEAR(engagement.closest().time_s(), engagement.missile().state().time_s, 0.01);
}

TEST(Engagement, RepeatsItselfExactly) {
  Engagement one({}, launch(), target_at);
  Engagement other({}, launch(), target_at);
  EXPECT_EQ(fly(one), fly(other));
}

TEST(Engagement, MissesByMoreWithADelayOfTheMeasurements) {
  Engagement prompt({}, launch(), target_at);
  fly(prompt);
  Engagement late({}, launch(), target_at);
  fly(late, 30);
  EXPECT_GT(late.closest().distance_m(), prompt.closest().distance_m());
}

TEST(Engagement, FliesStraightOnWithoutMeasurements) {
  Engagement engagement({}, launch(), target_at);
  const glm::dvec3 before = glm::normalize(engagement.missile().state().velocity_m_s);
  for (int i = 0; i < 200; ++i) engagement.advance(kPeriodS);
  // Gravity is held across the path, so the direction stays but for the lag of the autopilot.
  const glm::dvec3 after = glm::normalize(engagement.missile().state().velocity_m_s);
  EXPECT_LT(std::acos(glm::dot(before, after)), 0.01);
}

TEST(Engagement, PointsTheHeadToTheTargetAndKeepsItThere) {
  Engagement engagement({}, launch(), target_at);
  EXPECT_NEAR(engagement.boresight_error_rad(), 0.0, 1e-9);
  for (int i = 0; i < 500; ++i) {
    const double now_s = engagement.missile().state().time_s;
    engagement.measure(now_s,
                       glm::normalize(target_at(now_s) - engagement.missile().state().position_m));
    engagement.advance(kPeriodS);
    EXPECT_LT(engagement.boresight_error_rad(), 0.002);
  }
}

TEST(Engagement, RatesOfTheSeekerAreThoseOfItsPoses) {
  Engagement engagement({}, launch(), target_at);
  for (int i = 0; i < 300; ++i) {
    const double now_s = engagement.missile().state().time_s;
    engagement.measure(now_s,
                       glm::normalize(target_at(now_s) - engagement.missile().state().position_m));
    engagement.advance(kPeriodS);
  }
  const physics::Pose before = engagement.seeker_pose();
  const protocol::PoseRates first = engagement.seeker_rates();
  engagement.advance(1e-3);
  const physics::Pose after = engagement.seeker_pose();
  const glm::dvec3 velocity = (after.position_world_m - before.position_world_m) / 1e-3;
  EXPECT_LT(glm::length(velocity - first.velocity_world_m_s), 0.1);
  const glm::dquat turn = glm::conjugate(before.world_from_body) * after.world_from_body;
  const glm::dvec3 rate = 2.0 * glm::dvec3(turn.x, turn.y, turn.z) / 1e-3;
  EXPECT_LT(glm::length(rate - engagement.seeker_rates().angular_rate_body_rad_s), 1e-5);
}

TEST(Engagement, EndsOnTheGround) {
  Engagement engagement({}, launch(), target_at);
  for (int i = 0; i < 3000 && !engagement.finished(); ++i) engagement.advance(kPeriodS);
  EXPECT_TRUE(engagement.finished());
  EXPECT_GT(engagement.closest().distance_m(), 10.0);
}

TEST(Engagement, IgnoresAnswersThatAreNotNewer) {
  Engagement engagement({}, launch(), target_at);
  engagement.measure(0.0, glm::dvec3(0.0, 1.0, 0.0));
  engagement.measure(0.0, glm::dvec3(1.0, 0.0, 0.0));
  EXPECT_LT(glm::length(engagement.line_of_sight().direction_at(0.0) - glm::dvec3(0, 1, 0)), 1e-9);
}

}  // namespace
}  // namespace emit::server
