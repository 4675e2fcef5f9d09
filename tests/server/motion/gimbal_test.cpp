// SPDX-License-Identifier: Apache-2.0
#include "motion/gimbal.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <glm/ext/quaternion_double.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <random>
#include <vector>

#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

using physics::kDegree;
using physics::kPi;

std::vector<std::array<GimbalAxis, 3>> all_orders() {
  using enum GimbalAxis;
  return {{roll, pitch, yaw}, {roll, yaw, pitch}, {pitch, roll, yaw},
          {pitch, yaw, roll}, {yaw, roll, pitch}, {yaw, pitch, roll}};
}

ThreeAxisGimbal gimbal_of(const std::array<GimbalAxis, 3>& order) {
  auto gimbal = ThreeAxisGimbal::create(order);
  EXPECT_TRUE(gimbal.has_value());
  return *gimbal;
}

/// Rotation by a quaternion about the axis of a ring, which shares no code with the gimbal.
glm::dmat3 about(GimbalAxis ring, double angle_rad) {
  glm::dvec3 axis(0.0);
  axis[static_cast<glm::length_t>(ring)] = 1.0;
  return glm::mat3_cast(glm::angleAxis(angle_rad, axis));
}

double difference(const glm::dmat3& a, const glm::dmat3& b) {
  double most = 0.0;
  for (glm::length_t column = 0; column < 3; ++column) {
    most = std::max(most, glm::length(a[column] - b[column]));
  }
  return most;
}

/// Returns the angular velocity in axes of the payload by differences of its attitude.
glm::dvec3 measured_velocity(const std::function<glm::dmat3(double)>& attitude, double t_s) {
  constexpr double kDifferenceS = 1e-5;
  const glm::dmat3 change =
      (attitude(t_s + kDifferenceS) - attitude(t_s - kDifferenceS)) / (2.0 * kDifferenceS);
  const glm::dmat3 turn = glm::transpose(attitude(t_s)) * change;  // skew: columns are w x e
  return {turn[1][2], turn[2][0], turn[0][1]};
}

TEST(ThreeAxisGimbal, refuses_two_rings_about_one_axis) {
  EXPECT_FALSE(
      ThreeAxisGimbal::create({GimbalAxis::yaw, GimbalAxis::pitch, GimbalAxis::yaw}).has_value());
}

TEST(ThreeAxisGimbal, turns_as_quaternions_do_in_every_order) {
  for (const auto& order : all_orders()) {
    const glm::dvec3 angles(0.3, -0.9, 2.1);
    const glm::dmat3 expected = about(order[0], 0.3) * about(order[1], -0.9) * about(order[2], 2.1);
    EXPECT_LT(difference(gimbal_of(order).base_from_payload(angles), expected), 1e-14);
  }
}

TEST(ThreeAxisGimbal, finds_the_angles_nearest_to_where_it_is) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> angle_rad(-3.0 * kPi, 3.0 * kPi);
  for (const auto& order : all_orders()) {
    const ThreeAxisGimbal gimbal = gimbal_of(order);
    for (int i = 0; i < 1000; ++i) {
      const glm::dvec3 angles(angle_rad(random), angle_rad(random), angle_rad(random));
      if (std::abs(std::cos(angles.y)) < 1e-3) continue;
      const glm::dvec3 near = angles + glm::dvec3(1e-4, -1e-4, 1e-4);
      const glm::dvec3 found = gimbal.angles_rad(gimbal.base_from_payload(angles), near);
      EXPECT_LT(glm::length(found - angles), 1e-10) << i;
    }
  }
}

TEST(ThreeAxisGimbal, in_lock_the_outer_ring_stays_and_the_attitude_is_right) {
  for (const auto& order : all_orders()) {
    const ThreeAxisGimbal gimbal = gimbal_of(order);
    for (const double middle_rad : {0.5 * kPi, -0.5 * kPi, 1.5 * kPi}) {
      const glm::dmat3 attitude = gimbal.base_from_payload({0.4, middle_rad, -1.1});
      const glm::dvec3 near(1.3, middle_rad, 0.2);
      const glm::dvec3 found = gimbal.angles_rad(attitude, near);
      EXPECT_EQ(found.x, near.x);
      EXPECT_NEAR(found.y, middle_rad, 1e-8);
      EXPECT_LT(difference(gimbal.base_from_payload(found), attitude), 1e-8);
    }
  }
}

TEST(ThreeAxisGimbal, rates_and_accelerations_are_those_of_the_attitude) {
  const auto angles_at = [](double t_s) {
    return glm::dvec3(0.4 + 0.9 * t_s - 0.3 * t_s * t_s, 0.8 * std::sin(1.7 * t_s), -1.2 * t_s);
  };
  for (const auto& order : all_orders()) {
    const ThreeAxisGimbal gimbal = gimbal_of(order);
    const auto attitude = [&](double t_s) {
      const glm::dvec3 a = angles_at(t_s);
      return about(order[0], a.x) * about(order[1], a.y) * about(order[2], a.z);
    };
    for (const double t_s : {0.0, 0.35, 0.8, 1.4}) {
      constexpr double kDifferenceS = 1e-4;
      const glm::dvec3 velocity = measured_velocity(attitude, t_s);
      const glm::dvec3 acceleration = (measured_velocity(attitude, t_s + kDifferenceS) -
                                       measured_velocity(attitude, t_s - kDifferenceS)) /
                                      (2.0 * kDifferenceS);
      const auto motion = gimbal.motion(attitude(t_s), velocity, acceleration, angles_at(t_s));
      EXPECT_FALSE(motion.near_lock);
      const std::array<glm::dvec3, 2> expected = {
          glm::dvec3(0.9 - 0.6 * t_s, 0.8 * 1.7 * std::cos(1.7 * t_s), -1.2),
          glm::dvec3(-0.6, -0.8 * 1.7 * 1.7 * std::sin(1.7 * t_s), 0.0)};
      for (glm::length_t ring = 0; ring < 3; ++ring) {
        const AxisMotion& axis = motion.rings[static_cast<std::size_t>(ring)];
        EXPECT_NEAR(axis.angle_rad, angles_at(t_s)[ring], 1e-9);
        EXPECT_NEAR(axis.rate_rad_s, expected[0][ring], 1e-6);
        EXPECT_NEAR(axis.acceleration_rad_s2, expected[1][ring], 1e-3);
      }
      EXPECT_LT(glm::length(gimbal.angular_velocity_rad_s(angles_at(t_s), expected[0]) - velocity),
                1e-6);
    }
  }
}

TEST(ThreeAxisGimbal, near_lock_rates_stay_bounded_and_are_flagged) {
  for (const auto& order : all_orders()) {
    const ThreeAxisGimbal gimbal = gimbal_of(order);
    for (const double from_lock_rad : {4.0 * kDegree, 0.1 * kDegree, 1e-6, 0.0}) {
      const glm::dvec3 angles(0.2, 0.5 * kPi - from_lock_rad, -0.4);
      const glm::dmat3 attitude = gimbal.base_from_payload(angles);
      for (glm::length_t axis = 0; axis < 3; ++axis) {
        glm::dvec3 velocity(0.0);
        velocity[axis] = 1.0;
        const auto motion = gimbal.motion(attitude, velocity, glm::dvec3(0.0), angles);
        EXPECT_TRUE(motion.near_lock);
        for (const AxisMotion& ring : motion.rings) {
          EXPECT_LT(std::abs(ring.rate_rad_s), 12.0);
          EXPECT_TRUE(std::isfinite(ring.acceleration_rad_s2));
        }
      }
    }
  }
}

TEST(TwoAxisGimbal, points_at_the_target_and_follows_it) {
  const auto target_at = [](double t_s) {
    return glm::dvec3(900.0 - 150.0 * t_s, -200.0 + 340.0 * t_s, -120.0 + 60.0 * t_s * t_s);
  };
  for (const auto outer : {TwoAxisGimbal::Outer::azimuth, TwoAxisGimbal::Outer::elevation}) {
    const TwoAxisGimbal gimbal(outer);
    const auto motion_at = [&](double t_s) {
      return gimbal.motion(target_at(t_s), {-150.0, 340.0, 120.0 * t_s}, {0.0, 0.0, 120.0}, {});
    };
    for (const double t_s : {0.0, 0.5, 1.0, 2.5}) {
      const TwoAxisGimbal::Motion motion = motion_at(t_s);
      const glm::dvec3 sight =
          gimbal.base_from_payload(motion.azimuth.angle_rad, motion.elevation.angle_rad)[0];
      EXPECT_LT(glm::length(sight - glm::normalize(target_at(t_s))), 1e-14);
      EXPECT_FALSE(motion.near_lock);
      constexpr double kDifferenceS = 1e-5;
      const TwoAxisGimbal::Motion before = motion_at(t_s - kDifferenceS);
      const TwoAxisGimbal::Motion after = motion_at(t_s + kDifferenceS);
      for (const auto axis : {&TwoAxisGimbal::Motion::azimuth, &TwoAxisGimbal::Motion::elevation}) {
        EXPECT_NEAR((motion.*axis).rate_rad_s,
                    ((after.*axis).angle_rad - (before.*axis).angle_rad) / (2.0 * kDifferenceS),
                    1e-8);
        EXPECT_NEAR((motion.*axis).acceleration_rad_s2,
                    ((after.*axis).rate_rad_s - (before.*axis).rate_rad_s) / (2.0 * kDifferenceS),
                    1e-8);
      }
    }
  }
}

TEST(TwoAxisGimbal, a_positive_azimuth_is_right_and_a_positive_elevation_up) {
  for (const auto outer : {TwoAxisGimbal::Outer::azimuth, TwoAxisGimbal::Outer::elevation}) {
    const TwoAxisGimbal gimbal(outer);
    EXPECT_GT(gimbal.base_from_payload(0.1, 0.0)[0].y, 0.0);
    EXPECT_LT(gimbal.base_from_payload(0.0, 0.1)[0].z, 0.0);
    const auto motion = gimbal.motion({1.0, 0.1, -0.2}, glm::dvec3(0.0), glm::dvec3(0.0), {});
    EXPECT_GT(motion.azimuth.angle_rad, 0.0);
    EXPECT_GT(motion.elevation.angle_rad, 0.0);
  }
}

TEST(TwoAxisGimbal, a_target_on_the_outer_axis_leaves_the_outer_ring) {
  TwoAxisGimbal::Motion near;
  near.azimuth.angle_rad = 0.7;
  const auto up = TwoAxisGimbal(TwoAxisGimbal::Outer::azimuth)
                      .motion({0.0, 0.0, -5.0}, {1.0, 0.0, 0.0}, glm::dvec3(0.0), near);
  EXPECT_TRUE(up.near_lock);
  EXPECT_EQ(up.azimuth.angle_rad, 0.7);
  EXPECT_EQ(up.elevation.angle_rad, 0.5 * kPi);
  EXPECT_EQ(up.azimuth.rate_rad_s, 0.0);
}

TEST(TwoAxisGimbal, near_the_outer_axis_rates_stay_bounded_and_are_flagged) {
  for (const double reach : {0.08, 1e-3, 1e-6, 1e-9}) {
    const auto motion = TwoAxisGimbal(TwoAxisGimbal::Outer::azimuth)
                            .motion({reach, 0.0, -1.0}, {0.0, 1.0, 0.0}, glm::dvec3(0.0), {});
    EXPECT_TRUE(motion.near_lock);
    EXPECT_LT(std::abs(motion.azimuth.rate_rad_s), 12.0) << reach;
  }
}

TEST(TwoAxisGimbal, the_azimuth_goes_on_beyond_half_a_turn) {
  const TwoAxisGimbal gimbal(TwoAxisGimbal::Outer::azimuth);
  TwoAxisGimbal::Motion near;
  for (double azimuth_rad = 0.0; azimuth_rad < 7.0; azimuth_rad += 0.1) {
    near = gimbal.motion({std::cos(azimuth_rad), std::sin(azimuth_rad), 0.1}, glm::dvec3(0.0),
                         glm::dvec3(0.0), near);
    EXPECT_NEAR(near.azimuth.angle_rad, azimuth_rad, 1e-12);
  }
}

}  // namespace
}  // namespace emit::server
