// SPDX-License-Identifier: Apache-2.0
#include "history/entity_air.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/times.hpp"

namespace emit::renderer {
namespace {

using test::kSecondNs;

/// Returns an entity that flies east with that speed for an hour.
scene::ObjectDesc flyer(double speed_m_s, double height_m) {
  scene::ObjectDesc object;
  object.entity_id = 3;
  for (const std::int64_t s : {0, 3600}) {
    scene::Keyframe key;
    key.sim_time_ns = s * kSecondNs;
    key.pose.position_world_m = {speed_m_s * static_cast<double>(s), 0.0, height_m};
    object.trajectory.push_back(key);
  }
  return object;
}

IntervalForcing still_air() {
  IntervalForcing forcing;
  forcing.begin.flow.air_k = forcing.end.flow.air_k = 288.15;
  forcing.dt_s = 60.0;
  return forcing;
}

TEST(EntityAir, FollowsTheOwnSpeedAndHeight) {
  const PoseHistory jet(flyer(250.0, 10'000.0), {}, {.length_m = 15.0});
  const EntityAir air = entity_air(jet, still_air(), 60 * kSecondNs, 120 * kSecondNs);
  const double outside_k = 288.15 - 65.0;
  const double mach = 250.0 / std::sqrt(1.4 * 287.05 * outside_k);
  EXPECT_NEAR(air.begin_air_k, outside_k * (1.0 + 0.178 * mach * mach), 0.01);
  EXPECT_NEAR(air.end_air_k, air.begin_air_k, 0.01);
  EXPECT_NEAR(air.begin.upwind.x, 1.0, 1e-9);
  EXPECT_GT(air.begin.windward_w_m2_k, 60.0);
  // It exchanges what a plate does; its own windward side shows at the speed of a truck.
  EXPECT_EQ(air.begin.rough_frac, 0.0);
  const PoseHistory truck(flyer(15.0, 0.0), {}, {.length_m = 6.0});
  const EntityAir slow = entity_air(truck, still_air(), 60 * kSecondNs, 120 * kSecondNs);
  EXPECT_NEAR(slow.begin.windward_w_m2_k, 3.26 * std::pow(15.0 * 1.225 / 1.2, 0.89), 0.2);
  EXPECT_GT(slow.begin.windward_w_m2_k, 1.5 * slow.begin.leeward_w_m2_k);
}

TEST(EntityAir, KeepsTheRelativeHumidityHigherUp) {
  IntervalForcing forcing = still_air();
  const double ground_pa = 0.7 * physics::saturation_over_water_pa(288.15);
  forcing.begin.moist = forcing.end.moist = physics::moist_air(288.15, 101'325.0, ground_pa);
  const PoseHistory jet(flyer(250.0, 10'000.0), {}, {.length_m = 15.0});
  const EntityAir aloft = entity_air(jet, forcing, 60 * kSecondNs, 120 * kSecondNs);
  EXPECT_NEAR(aloft.begin_moist.vapour_pa, 0.7 * physics::saturation_over_water_pa(223.15), 1e-6);
  EXPECT_LT(aloft.begin_moist.vapour_pa, 0.01 * ground_pa);
  EXPECT_LT(aloft.end_moist.psychrometric_pa_k, 0.3 * forcing.end.moist.psychrometric_pa_k);
  const PoseHistory truck(flyer(15.0, 0.0), {}, {.length_m = 6.0});
  const EntityAir below = entity_air(truck, forcing, 60 * kSecondNs, 120 * kSecondNs);
  EXPECT_NEAR(below.begin_moist.vapour_pa, ground_pa, 1e-9);
  EXPECT_NEAR(below.begin_moist.heat_j_m3_k, forcing.begin.moist.heat_j_m3_k, 1e-9);
}

TEST(EntityAir, GoesOnWithTheMotionThatTheHostSentLast) {
  PoseHistory entity(flyer(0.0, 0.0), {});
  for (int i = 0; i <= 30; ++i) {
    physics::Pose pose;
    pose.position_world_m = {0.0, 2.0 * i, 0.0};
    ASSERT_TRUE(entity.append(i * kSecondNs / 10, pose, true, false));
  }
  // The interval lies after the newest pose.
  const auto motion = entity.motion(3 * kSecondNs, 60 * kSecondNs);
  EXPECT_NEAR(motion.velocity_m_s.y, 20.0, 0.1);
  EXPECT_NEAR(motion.undirected_m_s, 0.0, 0.1);
  // A jump is no motion.
  physics::Pose far;
  far.position_world_m = {5000.0, 0.0, 0.0};
  ASSERT_TRUE(entity.append(4 * kSecondNs, far, true, true));
  ASSERT_TRUE(entity.append(6 * kSecondNs, far, true, false));
  EXPECT_EQ(glm::length(entity.motion(6 * kSecondNs, 9 * kSecondNs).velocity_m_s), 0.0);
}

TEST(EntityAir, ACircleHasSpeedWithoutADirection) {
  scene::ObjectDesc object = flyer(0.0, 0.0);
  object.trajectory.clear();
  for (int i = 0; i <= 36; ++i) {
    scene::Keyframe key;
    key.sim_time_ns = i * kSecondNs;
    key.pose.position_world_m = {100.0 * std::cos(i * 0.174533), 100.0 * std::sin(i * 0.174533),
                                 0.0};
    object.trajectory.push_back(key);
  }
  const PoseHistory entity(object, {});
  const auto motion = entity.motion(0, 36 * kSecondNs);
  EXPECT_LT(glm::length(motion.velocity_m_s), 0.1);
  EXPECT_NEAR(motion.undirected_m_s, 17.4, 0.1);
}

}  // namespace
}  // namespace emit::renderer
