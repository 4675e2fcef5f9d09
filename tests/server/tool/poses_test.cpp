// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "support/times.hpp"
#include "tool/streams/pose_plan.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using emit::test::kSecondNs;

std::vector<std::uint64_t> all_of(PosePlan& plan) {
  std::vector<std::uint64_t> indices;
  while (const auto index = plan.next()) indices.push_back(*index);
  return indices;
}

TEST(CliPosePlan, a_fixed_count_spans_the_log_evenly) {
  PosePlan plan(101, 5);
  EXPECT_EQ(all_of(plan), (std::vector<std::uint64_t>{0, 25, 50, 75, 100}));
}

TEST(CliPosePlan, every_pose_is_played_when_all_are_asked_for) {
  PosePlan plan(4, 9);
  EXPECT_EQ(all_of(plan), (std::vector<std::uint64_t>{0, 1, 2, 3}));
}

TEST(CliPosePlan, limits_do_not_touch_a_fixed_count) {
  PosePlan plan(101, 5);
  EXPECT_EQ(plan.next(), 0U);
  plan.limit_to(50);
  EXPECT_EQ(plan.left(), 4U);
}

TEST(CliPosePlan, the_first_limit_sets_the_number_and_later_ones_only_lower_it) {
  PosePlan plan(1001, std::nullopt);
  EXPECT_EQ(plan.next(), 0U);
  EXPECT_EQ(plan.next(), 5U);
  EXPECT_EQ(plan.left(), PosePlan::kFirstGuess - 2);
  plan.limit_to(20);
  EXPECT_EQ(plan.left(), 20U);
  ASSERT_TRUE(plan.next().has_value());
  plan.limit_to(30);
  EXPECT_EQ(plan.left(), 19U);
  plan.limit_to(2);
  EXPECT_EQ(plan.left(), 2U);
  const auto rest = all_of(plan);
  EXPECT_EQ(rest.back(), 1000U);
}

TEST(CliPosePlan, at_least_four_poses_are_played_however_slow_the_device) {
  PosePlan plan(1001, std::nullopt);
  std::vector<std::uint64_t> indices;
  while (const auto index = plan.next()) {
    indices.push_back(*index);
    plan.limit_to(0);
  }
  ASSERT_GE(indices.size(), PosePlan::kMinimum);
  EXPECT_EQ(indices.front(), 0U);
  EXPECT_EQ(indices.back(), 1000U);
}

scene::Keyframe key(double time_s, double x_m) {
  scene::Keyframe frame;
  frame.sim_time_ns = std::llround(time_s * 1e9);
  frame.pose.position_world_m = {x_m, 0.0, 0.0};
  return frame;
}

scene::ScenarioDesc scenario_with_truck() {
  scene::ScenarioDesc scenario;
  scenario.sensor.trajectory = {key(10.0, 0.0), key(12.0, 20.0)};
  scene::ObjectDesc truck;
  truck.name = "truck";
  truck.entity_id = 7;
  truck.trajectory = {key(-9000.0, -50.0), key(0.0, -50.0), key(5.0, 0.0), key(905.0, 0.0),
                      key(910.0, 40.0)};
  scenario.objects.push_back(truck);
  scene::ObjectDesc ground;
  ground.name = "ground";
  scenario.objects.push_back(ground);
  return scenario;
}

TEST(CliDepartures, the_last_long_stay_of_an_entity_that_leaves_is_found) {
  const auto departures = find_departures(scenario_with_truck(), 60.0);
  ASSERT_EQ(departures.size(), 1U);
  EXPECT_EQ(departures[0].object, "truck");
  EXPECT_EQ(departures[0].arrived_ns, 5 * kSecondNs);
  EXPECT_EQ(departures[0].left_ns, 905 * kSecondNs);
  EXPECT_EQ(find_departures(scenario_with_truck(), 1000.0)[0].left_ns, 0);
  EXPECT_TRUE(find_departures(scenario_with_truck(), 10000.0).empty());
}

TEST(CliTrajectory, poses_are_linear_between_keyframes_and_hold_outside) {
  const scene::Trajectory path{key(10.0, 0.0), key(12.0, 20.0)};
  const auto at = [&](double time_s) {
    return sample_trajectory(path, std::llround(time_s * 1e9), 0).pose.position_world_m.x;
  };
  EXPECT_DOUBLE_EQ(at(9.0), 0.0);
  EXPECT_DOUBLE_EQ(at(10.5), 5.0);
  EXPECT_DOUBLE_EQ(at(12.0), 20.0);
  EXPECT_DOUBLE_EQ(at(99.0), 20.0);
}

TEST(CliTrajectory, rates_are_those_of_the_segment_and_zero_outside) {
  const scene::Trajectory path{key(10.0, 0.0), key(12.0, 20.0)};
  const auto inside = sample_trajectory(path, 11 * kSecondNs, 0);
  EXPECT_NEAR(inside.rates.velocity_world_m_s.x, 10.0, 1e-6);  // rounding of the difference, m/s
  const auto outside = sample_trajectory(path, 13 * kSecondNs, 0);
  EXPECT_EQ(glm::length(outside.rates.velocity_world_m_s), 0.0);
}

TEST(CliTrajectory, a_turn_gives_the_body_rate) {
  scene::Trajectory path{key(0.0, 0.0), key(1.0, 0.0)};
  path[0].pose.world_from_body = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  path[1].pose.world_from_body = physics::world_from_body_heading_pitch_roll(0.4, 0.0, 0.0);
  const auto sample = sample_trajectory(path, kSecondNs / 2, 0);
  // Heading grows clockwise seen from above. This is a positive rotation about the body's z, which
  // is down.
  EXPECT_NEAR(sample.rates.angular_rate_body_rad_s.z, 0.4, 1e-6);
  EXPECT_NEAR(sample.rates.angular_rate_body_rad_s.x, 0.0, 1e-6);
}

TEST(CliTrajectory, a_jump_is_reported_once_and_not_interpolated) {
  scene::Trajectory path{key(0.0, 0.0), key(1.0, 100.0)};
  path[1].teleport = true;
  EXPECT_EQ(sample_trajectory(path, kSecondNs / 2, 0).pose.position_world_m.x, 0.0);
  EXPECT_FALSE(sample_trajectory(path, kSecondNs / 2, 0).teleport);
  EXPECT_TRUE(sample_trajectory(path, kSecondNs, kSecondNs / 2).teleport);
  EXPECT_FALSE(sample_trajectory(path, 2 * kSecondNs, kSecondNs).teleport);
}

TEST(CliHostFrame, holds_seeker_and_moving_entities_at_the_samples_instant) {
  const auto scenario = scenario_with_truck();
  const auto frame = std::make_unique<protocol::HostFrameData>();
  make_host_frame(scenario, 10 * kSecondNs, 200.0, 100, *frame);
  EXPECT_EQ(frame->frame_number, 101U);
  EXPECT_EQ(frame->sim_time_ns, 10 * kSecondNs + kSecondNs / 2);
  EXPECT_DOUBLE_EQ(frame->seeker.position_world_m.x, 5.0);
  ASSERT_EQ(frame->entity_count, 1U);
  EXPECT_EQ(frame->entities[0].entity_id, 7U);
  EXPECT_TRUE(frame->entities[0].has_pose);
  EXPECT_TRUE(frame->entities[0].on);
  ASSERT_TRUE(frame->seeker_rates.has_value());
}

}  // namespace
}  // namespace emit::tool
