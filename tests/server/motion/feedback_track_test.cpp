// SPDX-License-Identifier: Apache-2.0
#include "motion/feedback_track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "support/times.hpp"

namespace emit::server {
namespace {

using test::kMs;

/// A cubic motion of all axes, which the track must give back exactly.
AxisFeedback feedback_at(std::int64_t time_ns) {
  const double t = 1e-9 * static_cast<double>(time_ns);
  AxisFeedback out;
  out.time_ns = time_ns;
  for (glm::length_t i = 0; i < 3; ++i) {
    const double scale = 1.0 + static_cast<double>(i);
    out.angles.unit_rad[i] = scale * (0.1 + 2.0 * t - 30.0 * t * t + 400.0 * t * t * t);
    out.unit_rates_rad_s[i] = scale * (2.0 - 60.0 * t + 1200.0 * t * t);
  }
  out.angles.target_rad = {0.5 * out.angles.unit_rad.x, -out.angles.unit_rad.y};
  out.target_rates_rad_s = {0.5 * out.unit_rates_rad_s.x, -out.unit_rates_rad_s.y};
  return out;
}

TEST(FeedbackTrack, is_exact_for_a_cubic_motion_between_measurements) {
  FeedbackTrack track;
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(track.add(feedback_at(i * kMs)));
  for (std::int64_t time_ns = 0; time_ns <= 19 * kMs; time_ns += 123'457) {
    const auto state = track.at(time_ns, 0);
    ASSERT_TRUE(state.has_value()) << time_ns;
    EXPECT_FALSE(state->extrapolated);
    const AxisFeedback truth = feedback_at(time_ns);
    EXPECT_LT(glm::length(state->angles.unit_rad - truth.angles.unit_rad), 1e-14);
    EXPECT_LT(glm::length(state->angles.target_rad - truth.angles.target_rad), 1e-14);
  }
}

TEST(FeedbackTrack, goes_on_at_the_latest_rates_as_far_as_the_horizon) {
  FeedbackTrack track;
  track.add(feedback_at(5 * kMs));
  const auto state = track.at(7 * kMs, 2 * kMs);
  ASSERT_TRUE(state.has_value());
  EXPECT_TRUE(state->extrapolated);
  const AxisFeedback last = feedback_at(5 * kMs);
  EXPECT_LT(
      glm::length(state->angles.unit_rad - (last.angles.unit_rad + 0.002 * last.unit_rates_rad_s)),
      1e-15);
  EXPECT_FALSE(track.at(7 * kMs + 1, 2 * kMs).has_value());
  EXPECT_FALSE(track.at(5 * kMs - 1, 2 * kMs).has_value());
}

TEST(FeedbackTrack, predicts_a_constant_acceleration) {
  const auto feedback = [](std::int64_t time_ns) {
    const double t = 1e-9 * static_cast<double>(time_ns);
    AxisFeedback out;
    out.time_ns = time_ns;
    out.angles.unit_rad = glm::dvec3(0.3 + 0.5 * t + 0.5 * 4.0 * t * t);
    out.unit_rates_rad_s = glm::dvec3(0.5 + 4.0 * t);
    out.angles.target_rad = glm::dvec2(-1.0 * t * t);
    out.target_rates_rad_s = glm::dvec2(-2.0 * t);
    return out;
  };
  FeedbackTrack track;
  for (int i = 0; i <= 100; ++i) track.add(feedback(i * kMs));
  const auto state = track.at(120 * kMs, 20 * kMs);
  ASSERT_TRUE(state.has_value());
  const AxisFeedback truth = feedback(120 * kMs);
  EXPECT_LT(glm::length(state->angles.unit_rad - truth.angles.unit_rad), 1e-12);
  EXPECT_LT(glm::length(state->angles.target_rad - truth.angles.target_rad), 1e-12);
}

TEST(FeedbackTrack, drops_what_is_not_later_and_keeps_the_latest) {
  FeedbackTrack track;
  EXPECT_EQ(track.latest(), nullptr);
  EXPECT_FALSE(track.at(0, kMs).has_value());
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(track.add(feedback_at(i * kMs)));
  EXPECT_FALSE(track.add(feedback_at(199 * kMs)));
  EXPECT_FALSE(track.add(feedback_at(10 * kMs)));
  EXPECT_EQ(track.latest()->time_ns, 199 * kMs);
  const auto oldest = 200 - static_cast<std::int64_t>(FeedbackTrack::kSamples);
  EXPECT_TRUE(track.at(oldest * kMs, 0).has_value());
  EXPECT_FALSE(track.at(oldest * kMs - 1, 0).has_value());
  track.clear();
  EXPECT_FALSE(track.at(199 * kMs, kMs).has_value());
}

}  // namespace
}  // namespace emit::server
