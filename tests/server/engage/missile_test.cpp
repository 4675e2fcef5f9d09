// SPDX-License-Identifier: Apache-2.0
#include "engage/missile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::server {
namespace {

constexpr double kStepS = 0.001;

MissileParameters without_air() {
  MissileParameters out;
  out.drag_coefficient = 0.0;
  out.induced_drag_per_rad2 = 0.0;
  return out;
}

MissileState launch_of(const glm::dvec3& velocity_m_s, double height_m = 1000.0) {
  MissileState out;
  out.position_m = {0.0, 0.0, height_m};
  out.velocity_m_s = velocity_m_s;
  return out;
}

TEST(Missile, FliesAParabolaWithoutAirAndCommand) {
  Missile missile(without_air(), launch_of({120.0, 50.0, 80.0}));
  for (int i = 0; i < 10000; ++i) missile.step(glm::dvec3(0.0), kStepS);
  const double t = missile.state().time_s;
  EXPECT_NEAR(t, 10.0, 1e-9);
  const glm::dvec3 expected{120.0 * t, 50.0 * t, 1000.0 + 80.0 * t - 0.5 * 9.80665 * t * t};
  EXPECT_LT(glm::length(missile.state().position_m - expected), 1e-7);
}

TEST(Missile, SlowsDownInAirByTheClosedFormOfQuadraticDrag) {
  MissileParameters parameters;
  parameters.gravity_m_s2 = 0.0;
  Missile missile(parameters, launch_of({300.0, 0.0, 0.0}));
  for (int i = 0; i < 5000; ++i) missile.step(glm::dvec3(0.0), kStepS);
  const double k = 0.5 * air_density_kg_m3(1000.0) * parameters.reference_area_m2 *
                   parameters.drag_coefficient / parameters.mass_kg;
  const double t = missile.state().time_s;
  EXPECT_NEAR(missile.state().velocity_m_s.x, 300.0 / (1.0 + k * 300.0 * t), 1e-8);
  EXPECT_NEAR(missile.state().position_m.x, std::log(1.0 + k * 300.0 * t) / k, 1e-6);
}

TEST(Missile, HasTheDensityOfTheStandardAtmosphere) {
  // ISO 2533, table 1.
  EXPECT_NEAR(air_density_kg_m3(0.0), 1.2250, 1e-4);
  EXPECT_NEAR(air_density_kg_m3(1000.0), 1.1117, 2e-4);
  EXPECT_NEAR(air_density_kg_m3(5000.0), 0.7364, 2e-4);
  EXPECT_NEAR(air_density_kg_m3(10000.0), 0.4135, 2e-4);
}

TEST(Missile, SpeedsUpWhileTheMotorBurnsAndNotAfterwards) {
  MissileParameters parameters = without_air();
  parameters.gravity_m_s2 = 0.0;
  parameters.thrust_n = 8500.0;
  parameters.burn_s = 2.0;
  Missile missile(parameters, launch_of({0.0, 100.0, 0.0}));
  for (int i = 0; i < 3000; ++i) missile.step(glm::dvec3(0.0), kStepS);
  EXPECT_NEAR(missile.state().velocity_m_s.y, 100.0 + 100.0 * 2.0, 0.11);
}

TEST(Missile, AnswersACommandWithAFirstOrderLag) {
  MissileParameters parameters = without_air();
  parameters.gravity_m_s2 = 0.0;
  Missile missile(parameters, launch_of({1000.0, 0.0, 0.0}));
  for (int i = 0; i < 100; ++i) missile.step({0.0, 10.0, 0.0}, kStepS);
  EXPECT_NEAR(glm::length(missile.state().lift_m_s2), 10.0 * (1.0 - std::exp(-1.0)), 1e-3);
}

TEST(Missile, TurnsWithTheRateOfItsLateralAccelerationAndKeepsItsSpeed) {
  MissileParameters parameters = without_air();
  parameters.gravity_m_s2 = 0.0;
  parameters.autopilot_lag_s = 0.001;
  Missile missile(parameters, launch_of({300.0, 0.0, 0.0}));
  for (int i = 0; i < 2000; ++i) {
    const glm::dvec3 v = missile.state().velocity_m_s;
    missile.step(60.0 * glm::normalize(glm::cross(glm::dvec3(0.0, 0.0, 1.0), v)), 1e-3);
  }
  const glm::dvec3 v = missile.state().velocity_m_s;
  EXPECT_NEAR(std::atan2(v.y, v.x), 60.0 / 300.0 * 2.0, 1e-3);
  EXPECT_NEAR(glm::length(v), 300.0, 0.05);
}

TEST(Missile, NeverPullsMoreThanStructureAndAngleOfAttackAllow) {
  MissileParameters parameters = without_air();
  Missile fast(parameters, launch_of({600.0, 0.0, 0.0}));
  EXPECT_DOUBLE_EQ(fast.available_m_s2(), parameters.max_acceleration_m_s2);
  Missile slow(parameters, launch_of({100.0, 0.0, 0.0}));
  const double lift = 0.5 * air_density_kg_m3(1000.0) * 100.0 * 100.0 *
                      parameters.reference_area_m2 * parameters.normal_force_per_rad *
                      parameters.max_angle_of_attack_rad / parameters.mass_kg;
  EXPECT_NEAR(slow.available_m_s2(), lift, 1e-9);
  for (int i = 0; i < 1000; ++i) {
    slow.step({1e6, 1e6, 0.0}, kStepS);
    fast.step({1e6, 1e6, 0.0}, kStepS);
    EXPECT_LE(glm::length(fast.state().lift_m_s2), parameters.max_acceleration_m_s2 * 1.0001);
    EXPECT_LE(slow.angle_of_attack_rad(), parameters.max_angle_of_attack_rad * 1.01);
  }
  EXPECT_GT(glm::length(fast.state().lift_m_s2), 0.99 * parameters.max_acceleration_m_s2);
}

TEST(Missile, PointsItsBodyByTheAngleOfAttackTowardsTheLift) {
  Missile missile(MissileParameters{}, launch_of({0.0, 250.0, 0.0}));
  for (int i = 0; i < 300; ++i) missile.step({0.0, 0.0, 40.0}, kStepS);
  const glm::dvec3 axis = missile.world_from_body() * glm::dvec3(1.0, 0.0, 0.0);
  const glm::dvec3 forward = glm::normalize(missile.state().velocity_m_s);
  EXPECT_GT(axis.z, forward.z);
  EXPECT_NEAR(std::acos(glm::dot(axis, forward)), missile.angle_of_attack_rad(), 1e-9);
  EXPECT_GT(missile.angle_of_attack_rad(), 0.05);
  const glm::dvec3 right = missile.world_from_body() * glm::dvec3(0.0, 1.0, 0.0);
  EXPECT_NEAR(right.z, 0.0, 1e-12);  // no roll
}

TEST(Missile, LosesMoreSpeedInATurnThanStraight) {
  MissileParameters parameters;
  parameters.gravity_m_s2 = 0.0;
  Missile straight(parameters, launch_of({250.0, 0.0, 0.0}));
  Missile turning(parameters, launch_of({250.0, 0.0, 0.0}));
  for (int i = 0; i < 2000; ++i) {
    straight.step(glm::dvec3(0.0), kStepS);
    turning.step({0.0, 60.0, 0.0}, kStepS);
  }
  EXPECT_LT(glm::length(turning.state().velocity_m_s),
            glm::length(straight.state().velocity_m_s) - 1.0);
}

}  // namespace
}  // namespace emit::server
