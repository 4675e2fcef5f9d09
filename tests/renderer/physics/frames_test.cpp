// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/frames.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <random>

#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

// Bound for the rounding of a few products of unit quantities.
constexpr double kTolerance = 1e-14;

void expect_near(const glm::dvec3& a, const glm::dvec3& b, double tolerance = kTolerance) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

const glm::dvec3 kForward(1, 0, 0);
const glm::dvec3 kRight(0, 1, 0);
const glm::dvec3 kDown(0, 0, 1);

TEST(Frames, LevelAndNorthIsHalfATurnAboutNorthEast) {
  const glm::dquat q = world_from_body_heading_pitch_roll(0, 0, 0);
  EXPECT_NEAR(q.w, 0.0, kTolerance);
  EXPECT_NEAR(q.x, std::sqrt(0.5), kTolerance);
  EXPECT_NEAR(q.y, std::sqrt(0.5), kTolerance);
  EXPECT_NEAR(q.z, 0.0, kTolerance);
  expect_near(q * kForward, {0, 1, 0});
  expect_near(q * kRight, {1, 0, 0});
  expect_near(q * kDown, {0, 0, -1});
}

TEST(Frames, HeadingTurnsClockwisePitchRaisesTheNoseRollLowersTheRightSide) {
  const double a = 0.3;
  expect_near(world_from_body_heading_pitch_roll(a, 0, 0) * kForward,
              {std::sin(a), std::cos(a), 0});
  expect_near(world_from_body_heading_pitch_roll(0, a, 0) * kForward,
              {0, std::cos(a), std::sin(a)});
  expect_near(world_from_body_heading_pitch_roll(0, 0, a) * kRight, {std::cos(a), 0, -std::sin(a)});
}

TEST(Frames, SensorLooksAlongTheBodysXAxisWithRowsGoingDown) {
  expect_near(sensor_from_body() * kForward, {0, 0, 1});
  expect_near(sensor_from_body() * kRight, {1, 0, 0});
  expect_near(sensor_from_body() * kDown, {0, 1, 0});
}

TEST(Frames, LookAtPointsAtTheTargetWithoutRoll) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> coordinate(-1000.0, 1000.0);
  for (int i = 0; i < 1000; ++i) {
    const glm::dvec3 eye(coordinate(random), coordinate(random), coordinate(random));
    const glm::dvec3 target(coordinate(random), coordinate(random), coordinate(random));
    const glm::dquat q = world_from_body_look_at(eye, target);
    expect_near(q * kForward, glm::normalize(target - eye), 1e-12);
    EXPECT_NEAR((q * kRight).z, 0.0, 1e-12);
    EXPECT_LE((q * kDown).z, 1e-12);
  }
}

TEST(Frames, LookAtStraightDownOrUpPutsNorthAtTheTop) {
  for (const double z : {-1.0, 1.0}) {
    const glm::dquat q = world_from_body_look_at({5, 6, 7}, {5, 6, 7 + z});
    expect_near(q * kForward, {0, 0, z});
    expect_near(q * kDown, {0, -1, 0});
  }
}

TEST(Frames, PoseIsValidOnlyWithFiniteNumbersAndAUnitQuaternion) {
  Pose pose;
  EXPECT_TRUE(is_valid(pose));
  pose.world_from_body = glm::dquat(1.02, 0, 0, 0);
  EXPECT_FALSE(is_valid(pose));
  pose.world_from_body = glm::dquat(0, 0, 0, 0);
  EXPECT_FALSE(is_valid(pose));
  pose.world_from_body = glm::dquat(std::nan(""), 0, 0, 0);
  EXPECT_FALSE(is_valid(pose));
  pose = {};
  pose.position_world_m.y = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(is_valid(pose));
}

TEST(Frames, InterpolationIsLinearInPositionAndUniformInAngle) {
  const Pose from{{0, 0, 0}, world_from_body_heading_pitch_roll(0, 0, 0)};
  const Pose to{{10, -20, 30}, world_from_body_heading_pitch_roll(1, 0, 0)};
  for (const double s : {0.0, 0.25, 1.0, 1.5, -0.5}) {
    const Pose p = interpolate(from, to, s);
    expect_near(p.position_world_m, glm::dvec3(10, -20, 30) * s);
    expect_near(p.world_from_body * kForward, {std::sin(s), std::cos(s), 0}, 1e-12);
  }
}

TEST(Frames, InterpolationTakesTheShortArcWhateverTheSignOfTheQuaternion) {
  const Pose from{{0, 0, 0}, world_from_body_heading_pitch_roll(0, 0, 0)};
  Pose to{{0, 0, 0}, -world_from_body_heading_pitch_roll(0.2, 0, 0)};
  expect_near(interpolate(from, to, 0.5).world_from_body * kForward,
              {std::sin(0.1), std::cos(0.1), 0}, 1e-12);
}

}  // namespace
}  // namespace emit::physics
