// SPDX-License-Identifier: Apache-2.0
#include "gnss/truth_trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "gnss/local_fit.hpp"

namespace emit::server {
namespace {

using ::testing::HasSubstr;

/// A circle of 1000 m at 300 m/s with a climb and a roll that swings: 90 m/s2, 27 m/s3.
TruthState circle_at(double time_s) {
  constexpr double kRadiusM = 1000.0;
  constexpr double kTurnRadS = 0.3;
  constexpr double kClimbMS = 20.0;
  constexpr double kPitch = 0.2;
  const double a = kTurnRadS * time_s;
  const double w = kTurnRadS;
  TruthState out;
  out.pose.position_world_m = {kRadiusM * std::cos(a), kRadiusM * std::sin(a), kClimbMS * time_s};
  out.velocity_m_s = {-kRadiusM * w * std::sin(a), kRadiusM * w * std::cos(a), kClimbMS};
  out.acceleration_m_s2 = glm::dvec3(-std::cos(a), -std::sin(a), 0.0) * (kRadiusM * w * w);
  out.jerk_m_s3 = glm::dvec3(std::sin(a), -std::cos(a), 0.0) * (kRadiusM * w * w * w);
  // The turn to the left lowers the heading.
  const double roll = 0.5 * std::sin(2.0 * time_s);
  const double roll1 = std::cos(2.0 * time_s);
  const double roll2 = -2.0 * std::sin(2.0 * time_s);
  out.pose.world_from_body = physics::world_from_body_heading_pitch_roll(-a, kPitch, roll);
  const double level = -w * std::cos(kPitch);
  out.angular_rate_rad_s = {roll1 + w * std::sin(kPitch), level * std::sin(roll),
                            level * std::cos(roll)};
  out.angular_acceleration_rad_s2 = {roll2, level * std::cos(roll) * roll1,
                                     -level * std::sin(roll) * roll1};
  out.angular_jerk_rad_s3 = {-4.0 * roll1,
                             level * (-std::sin(roll) * roll1 * roll1 + std::cos(roll) * roll2),
                             level * (-std::cos(roll) * roll1 * roll1 - std::sin(roll) * roll2)};
  return out;
}

TruthPose pose_of(const TruthState& state, std::int64_t time_ns, bool rates) {
  TruthPose out{time_ns, state.pose, std::nullopt};
  if (rates) out.rates = {state.velocity_m_s, state.angular_rate_rad_s};
  return out;
}

std::vector<TruthPose> circle(double rate_hz, double length_s, bool rates) {
  std::vector<TruthPose> out;
  for (int i = 0; i <= static_cast<int>(length_s * rate_hz); ++i) {
    const auto time_ns = static_cast<std::int64_t>(std::llround(1e9 * i / rate_hz));
    out.push_back(pose_of(circle_at(1e-9 * static_cast<double>(time_ns)), time_ns, rates));
  }
  return out;
}

struct Worst {
  double position_m = 0.0;
  double velocity_m_s = 0.0;
  double acceleration_m_s2 = 0.0;
  double jerk_m_s3 = 0.0;
  double attitude_rad = 0.0;
  double rate_rad_s = 0.0;
  double angular_acceleration_rad_s2 = 0.0;
  double angular_jerk_rad_s3 = 0.0;
};

/// Returns the greatest errors against the circle, at instants that are no poses too.
Worst worst_of(const TruthTrajectory& trajectory) {
  Worst out;
  const auto keep = [](double& worst, const glm::dvec3& a, const glm::dvec3& b) {
    worst = std::max(worst, glm::distance(a, b));
  };
  for (std::int64_t t = trajectory.first_ns(); t <= trajectory.last_ns(); t += 3'700'000) {
    const TruthState is = trajectory.at(t);
    const TruthState should = circle_at(1e-9 * static_cast<double>(t));
    keep(out.position_m, is.pose.position_world_m, should.pose.position_world_m);
    keep(out.velocity_m_s, is.velocity_m_s, should.velocity_m_s);
    keep(out.acceleration_m_s2, is.acceleration_m_s2, should.acceleration_m_s2);
    keep(out.jerk_m_s3, is.jerk_m_s3, should.jerk_m_s3);
    keep(out.rate_rad_s, is.angular_rate_rad_s, should.angular_rate_rad_s);
    keep(out.angular_acceleration_rad_s2, is.angular_acceleration_rad_s2,
         should.angular_acceleration_rad_s2);
    keep(out.angular_jerk_rad_s3, is.angular_jerk_rad_s3, should.angular_jerk_rad_s3);
    const glm::dquat turn = glm::conjugate(is.pose.world_from_body) * should.pose.world_from_body;
    out.attitude_rad =
        std::max(out.attitude_rad, 2.0 * glm::length(glm::dvec3(turn.x, turn.y, turn.z)));
  }
  return out;
}

class TruthCircle : public testing::TestWithParam<std::tuple<double, bool>> {};

TEST_P(TruthCircle, is_met_with_its_derivatives) {
  const auto [rate_hz, rates] = GetParam();
  const auto trajectory = TruthTrajectory::create(circle(rate_hz, 10.0, rates));
  ASSERT_TRUE(trajectory.has_value()) << trajectory.error().text;
  EXPECT_EQ(trajectory->has_rates(), rates);
  const Worst worst = worst_of(*trajectory);
  EXPECT_LT(worst.position_m, 1e-3);
  EXPECT_LT(worst.velocity_m_s, 1e-3);
  EXPECT_LT(worst.acceleration_m_s2, 1e-2);
  EXPECT_LT(worst.jerk_m_s3, 0.2);
  EXPECT_LT(worst.attitude_rad, 2e-5);
  EXPECT_LT(worst.rate_rad_s, rate_hz < 50.0 ? 5e-3 : 2e-4);
  EXPECT_LT(worst.angular_acceleration_rad_s2, rate_hz < 50.0 ? 0.2 : 0.02);
  EXPECT_LT(worst.angular_jerk_rad_s3, rate_hz < 50.0 ? 2.0 : 0.5);
  RecordProperty("position_m", std::to_string(worst.position_m));
}
INSTANTIATE_TEST_SUITE_P(Logs, TruthCircle,
                         testing::Combine(testing::Values(1000.0, 200.0, 100.0, 50.0, 20.0),
                                          testing::Bool()));

/// A CSV with four decimals is no smooth motion any more, and its derivatives are to stay useful.
TEST(Truth, rounded_positions_keep_useful_derivatives) {
  for (const bool rates : {false, true}) {
    auto poses = circle(200.0, 10.0, rates);
    const auto round = [](glm::dvec3& v) {
      for (glm::length_t i = 0; i < 3; ++i) v[i] = 1e-4 * std::round(1e4 * v[i]);
    };
    for (TruthPose& pose : poses) {
      round(pose.pose.position_world_m);
      if (pose.rates) round(pose.rates->velocity_world_m_s);
    }
    const auto trajectory = TruthTrajectory::create(poses);
    ASSERT_TRUE(trajectory.has_value()) << trajectory.error().text;
    const Worst worst = worst_of(*trajectory);
    EXPECT_LT(worst.position_m, 2e-4);
    EXPECT_LT(worst.velocity_m_s, 2e-2);
    EXPECT_LT(worst.acceleration_m_s2, rates ? 0.05 : 2.0);
  }
}

TEST(Truth, passes_through_every_pose) {
  const auto poses = circle(20.0, 3.0, false);
  const auto trajectory = TruthTrajectory::create(poses);
  ASSERT_TRUE(trajectory.has_value());
  for (const TruthPose& pose : poses) {
    const TruthState state = trajectory->at(pose.sim_time_ns);
    EXPECT_LT(glm::distance(state.pose.position_world_m, pose.pose.position_world_m), 1e-9);
    EXPECT_NEAR(std::abs(glm::dot(state.pose.world_from_body, pose.pose.world_from_body)), 1.0,
                1e-12);
  }
}

TEST(Truth, two_poses_make_a_straight_line) {
  auto poses = circle(20.0, 0.05, false);
  ASSERT_EQ(poses.size(), 2U);
  const auto trajectory = TruthTrajectory::create(poses);
  ASSERT_TRUE(trajectory.has_value()) << trajectory.error().text;
  const TruthState middle = trajectory->at(25'000'000);
  EXPECT_LT(glm::distance(middle.pose.position_world_m,
                          0.5 * (poses[0].pose.position_world_m + poses[1].pose.position_world_m)),
            1e-9);
  EXPECT_EQ(glm::length(middle.acceleration_m_s2), 0.0);
}

/// A missile that rolls ten times a second is sampled at 200 Hz without rates.
TEST(Truth, a_fast_roll_is_followed) {
  std::vector<TruthPose> poses;
  const double rate_rad_s = 62.8;
  const auto attitude = [&](double time_s) {
    return physics::world_from_body_heading_pitch_roll(1.0, 0.3, rate_rad_s * time_s);
  };
  for (int i = 0; i <= 200; ++i) {
    poses.push_back({i * std::int64_t{5'000'000}, {{0, 0, 100}, attitude(5e-3 * i)}, {}});
  }
  const auto trajectory = TruthTrajectory::create(poses);
  ASSERT_TRUE(trajectory.has_value());
  const TruthState state = trajectory->at(502'300'000);
  EXPECT_NEAR(state.angular_rate_rad_s.x, rate_rad_s, 1e-6);
  EXPECT_NEAR(state.angular_rate_rad_s.y, 0.0, 1e-6);
  EXPECT_NEAR(std::abs(glm::dot(state.pose.world_from_body, attitude(0.5023))), 1.0, 1e-9);
}

/// Changes poses of a good log at 100 Hz; pose 101 is at 1 s.
std::string refusal(bool rates, const std::function<void(std::vector<TruthPose>&)>& change) {
  auto poses = circle(100.0, 3.0, rates);
  change(poses);
  const auto trajectory = TruthTrajectory::create(poses);
  return trajectory ? "" : trajectory.error().text;
}

TEST(Truth, logs_that_are_no_single_motion_are_refused_with_their_instants) {
  for (const bool rates : {false, true}) {
    EXPECT_EQ(refusal(rates, [](auto&) {}), "");
    EXPECT_THAT(refusal(rates, [](auto& poses) { poses[100].sim_time_ns = 5'000'000; }),
                HasSubstr("pose 101 at 0.005000 s follows pose 100 at 0.990000 s: time goes back"));
    EXPECT_THAT(refusal(rates, [](auto& poses) { poses[100].sim_time_ns -= 10'000'000; }),
                HasSubstr("pose 100 at 0.990000 s and pose 101 at 0.990000 s differ"));
    EXPECT_THAT(
        refusal(rates, [](auto& poses) { poses.erase(poses.begin() + 100, poses.begin() + 220); }),
        HasSubstr("no pose for 1.210 s between pose 100 at 0.990000 s and pose 101 at 2.200000 s"));
    // Everything from 1 s on lies elsewhere.
    EXPECT_THAT(refusal(rates,
                        [](auto& poses) {
                          for (std::size_t i = 100; i < poses.size(); ++i) {
                            poses[i].pose.position_world_m.z += 40.0;
                          }
                        }),
                HasSubstr("from pose 100 at 0.990000 s to pose 101 at 1.000000 s"));
    // One pose is wrong, at an end too.
    for (const std::size_t wrong : {std::size_t{0}, std::size_t{100}, std::size_t{300}}) {
      EXPECT_THAT(
          refusal(rates, [&](auto& poses) { poses[wrong].pose.position_world_m.x += 40.0; }),
          HasSubstr("a jump of"))
          << wrong;
    }
    EXPECT_THAT(refusal(rates, [](auto& poses) { poses[100].pose.position_world_m.y = 1e6; }),
                HasSubstr("m/s"));
    EXPECT_THAT(refusal(rates, [](auto& poses) { poses.resize(1); }),
                HasSubstr("1 poses make no trajectory"));
  }
}

TEST(Truth, a_pose_that_stands_twice_counts_once) {
  auto poses = circle(100.0, 1.0, true);
  poses.insert(poses.begin() + 50, poses[50]);
  const auto trajectory = TruthTrajectory::create(poses);
  ASSERT_TRUE(trajectory.has_value()) << trajectory.error().text;
  EXPECT_EQ(trajectory->size(), 101U);
}

TEST(Truth, corners_and_stops_of_a_course_are_no_jumps) {
  // A course goes straight at 30 m/s, turns by a right angle, and stops.
  std::vector<TruthPose> poses;
  glm::dvec3 position(0.0);
  for (int i = 0; i < 300; ++i) {
    const glm::dvec3 velocity = i < 100   ? glm::dvec3(30, 0, 0)
                                : i < 200 ? glm::dvec3(0, 30, 0)
                                          : glm::dvec3(0.0);
    poses.push_back({i * std::int64_t{10'000'000}, {position, {1, 0, 0, 0}}, {}});
    position += 0.01 * velocity;
  }
  const auto trajectory = TruthTrajectory::create(poses);
  ASSERT_TRUE(trajectory.has_value()) << trajectory.error().text;
  EXPECT_NEAR(trajectory->at(2'900'000'000).velocity_m_s.y, 0.0, 1e-9);
}

TEST(LocalFit, a_polynomial_is_met_with_its_derivatives) {
  std::vector<FitSample> samples;
  const auto value = [](double t) {
    return glm::dvec3(1.0 + t - 2.0 * t * t + 3.0 * t * t * t, t * t, 5.0);
  };
  for (const double t : {-0.3, -0.2, 0.0, 0.05, 0.4, 0.5}) samples.push_back({t, value(t)});
  const double t = 0.1;
  const auto fit = fit_at(samples, 3, t);
  const auto near = [](const glm::dvec3& is, const glm::dvec3& should) {
    EXPECT_LT(glm::distance(is, should), 1e-11);
  };
  near(fit[0], value(t));
  near(fit[1], {1.0 - 4.0 * t + 9.0 * t * t, 2.0 * t, 0.0});
  near(fit[2], {-4.0 + 18.0 * t, 2.0, 0.0});
  near(fit[3], {18.0, 0.0, 0.0});
}

}  // namespace
}  // namespace emit::server
