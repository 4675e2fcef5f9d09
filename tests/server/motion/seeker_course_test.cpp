// SPDX-License-Identifier: Apache-2.0
#include "motion/seeker_course.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "support/times.hpp"

namespace emit::server {
namespace {

using test::kMs;

double seconds(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

/// Angle of the rotation between two attitudes.
double angle_between(const glm::dmat3& a, const glm::dmat3& b) {
  const glm::dmat3 turn = glm::transpose(a) * b;
  return glm::length(glm::dvec3(turn[1][2] - turn[2][1], turn[2][0] - turn[0][2],
                                turn[0][1] - turn[1][0])) /
         2.0;
}

struct Truth {
  SeekerPose pose;
  TimedPoint target;
};

/// A seeker that turns faster and faster about an axis of its own, and a target that falls.
Truth truth_at(std::int64_t sim_time_ns) {
  const double t = seconds(sim_time_ns);
  Truth truth;
  SeekerPose& out = truth.pose;
  out.sim_time_ns = sim_time_ns;
  out.seeker.position_world_m = {250.0 * t, 0.0, 100.0};
  out.seeker.world_from_body =
      glm::angleAxis(0.7 * t + 0.5 * 3.0 * t * t, glm::normalize(glm::dvec3(1.0, 2.0, -1.0)));
  truth.target.sim_time_ns = sim_time_ns;
  truth.target.position_m = {1000.0, 40.0 * t, 90.0 - 0.5 * 9.81 * t * t};
  return truth;
}

void push(SeekerCourse& course, std::int64_t sim_time_ns) {
  const Truth truth = truth_at(sim_time_ns);
  course.push(truth.pose);
  course.push_target(truth.target);
}

void expect_truth(const SeekerCourse& course, std::int64_t sim_time_ns, double tolerance_rad,
                  double tolerance_m) {
  const SeekerState state = course.at(sim_time_ns);
  const Truth truth = truth_at(sim_time_ns);
  EXPECT_LT(
      angle_between(state.world_from_seeker, glm::mat3_cast(truth.pose.seeker.world_from_body)),
      tolerance_rad);
  EXPECT_LT(
      glm::distance(state.target_m, truth.target.position_m - truth.pose.seeker.position_world_m),
      tolerance_m);
  const double t = seconds(sim_time_ns);
  EXPECT_NEAR(glm::length(state.angular_velocity_rad_s), 0.7 + 3.0 * t, 1e-4);
  EXPECT_NEAR(glm::length(state.angular_acceleration_rad_s2), 3.0, 1e-3);
  EXPECT_LT(glm::distance(state.target_velocity_m_s, glm::dvec3(-250.0, 40.0, -9.81 * t)), 1e-3);
  EXPECT_LT(glm::distance(state.target_acceleration_m_s2, glm::dvec3(0.0, 0.0, -9.81)), 1e-3);
}

TEST(SeekerCourse, predicts_constant_accelerations_from_three_poses) {
  SeekerCourse course;
  for (std::int64_t t = 0; t <= 30 * kMs; t += 10 * kMs) push(course, t);
  EXPECT_EQ(course.interval_ns(), 10 * kMs);
  expect_truth(course, 30 * kMs, 1e-7, 1e-6);
  expect_truth(course, 47 * kMs, 1e-7, 1e-6);
}

TEST(SeekerCourse, takes_rates_of_the_host_before_differences) {
  SeekerCourse course;
  // The poses stand still, so that differences would tell no motion.
  for (std::int64_t t : {0 * kMs, 10 * kMs}) {
    SeekerPose pose;
    pose.sim_time_ns = t;
    pose.rates = protocol::PoseRates{{3.0, 0.0, 0.0}, {0.0, 0.1 + 0.2 * seconds(t), 0.0}};
    course.push(pose);
    course.push_target({t, {100.0, 0.0, 0.0}, glm::dvec3(0.0, 7.0, 0.0), false});
  }
  const SeekerState state = course.at(20 * kMs);
  EXPECT_NEAR(state.angular_velocity_rad_s.y, 0.1 + 0.2 * 0.02, 1e-12);
  EXPECT_NEAR(state.angular_acceleration_rad_s2.y, 0.2, 1e-9);
  EXPECT_LT(glm::distance(state.target_velocity_m_s, glm::dvec3(-3.0, 7.0, 0.0)), 1e-12);
}

TEST(SeekerCourse, a_single_pose_stands_still) {
  SeekerCourse course;
  EXPECT_TRUE(course.empty());
  push(course, 10 * kMs);
  EXPECT_EQ(course.interval_ns(), 0);
  const SeekerState state = course.at(50 * kMs);
  EXPECT_EQ(glm::length(state.angular_velocity_rad_s), 0.0);
  EXPECT_EQ(glm::length(state.target_velocity_m_s), 0.0);
}

TEST(SeekerCourse, drops_older_poses_and_stands_where_time_stands) {
  SeekerCourse course;
  for (std::int64_t t : {0 * kMs, 10 * kMs, 20 * kMs}) push(course, t);
  push(course, 5 * kMs);
  expect_truth(course, 25 * kMs, 1e-7, 1e-6);
  EXPECT_EQ(course.newest_ns(), 20 * kMs);
  // A host that pauses sends the same instant again, with the rates of before.
  SeekerPose again = truth_at(20 * kMs).pose;
  again.rates = protocol::PoseRates{{9.0, 9.0, 9.0}, {1.0, 1.0, 1.0}};
  course.push(again);
  EXPECT_EQ(glm::length(course.at(60 * kMs).angular_velocity_rad_s), 0.0);
}

TEST(SeekerCourse, poses_too_close_together_replace_each_other) {
  SeekerCourse course;
  for (std::int64_t t : {0 * kMs, 10 * kMs, 20 * kMs}) push(course, t);
  SeekerPose noisy = truth_at(20 * kMs).pose;
  noisy.sim_time_ns += 1000;
  noisy.seeker.world_from_body *= glm::angleAxis(1e-7, glm::dvec3(0.0, 0.0, 1.0));
  course.push(noisy);
  // A microsecond of noise would be a rate of 0.1 rad/s.
  EXPECT_NEAR(glm::length(course.at(20 * kMs).angular_velocity_rad_s), 0.76, 1e-3);
}

TEST(SeekerCourse, a_target_may_come_more_seldom_than_the_seeker_and_jump) {
  SeekerCourse course;
  EXPECT_FALSE(course.has_target());
  for (std::int64_t t = 0; t <= 200 * kMs; t += 10 * kMs) {
    course.push(truth_at(t).pose);
    if (t % (50 * kMs) == 0) course.push_target(truth_at(t).target);
  }
  expect_truth(course, 230 * kMs, 1e-6, 1e-6);
  course.push_target({210 * kMs, {0.0, 5000.0, 0.0}, std::nullopt, true});
  course.push(truth_at(210 * kMs).pose);
  const SeekerState state = course.at(215 * kMs);
  EXPECT_LT(glm::distance(state.target_velocity_m_s, glm::dvec3(-250.0, 0.0, 0.0)), 1e-3)
      << "a jump is no motion";
}

TEST(SeekerCourse, a_target_at_the_seeker_or_none_counts_as_straight_ahead) {
  SeekerCourse course;
  const SeekerPose pose = truth_at(0).pose;
  course.push(pose);
  const auto expect_ahead = [&] {
    const SeekerState state = course.at(0);
    EXPECT_NEAR(glm::dot(state.target_m, state.world_from_seeker[0]), 1.0, 1e-12);
  };
  expect_ahead();
  course.push_target({0, pose.seeker.position_world_m, std::nullopt, false});
  expect_ahead();
}

}  // namespace
}  // namespace emit::server
