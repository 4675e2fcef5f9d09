// SPDX-License-Identifier: Apache-2.0
#include "pacing/quality_policy.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace emit::server {
namespace {

constexpr std::array<renderer::RungStats, 4> kRungs{
    {{1.0, 0.0}, {0.7, 0.2}, {0.75, 0.3}, {0.4, 2.0}}};
constexpr std::int64_t kMs = 1'000'000;

TEST(QualityPolicy, full_quality_while_it_fits_or_nothing_is_known) {
  QualityPolicy policy;
  EXPECT_EQ(policy.choose(kRungs, 10 * kMs), 0U);
  policy.finished(9 * kMs, 1.0);
  EXPECT_EQ(policy.choose(kRungs, 10 * kMs), 0U);
}

TEST(QualityPolicy, sheds_what_costs_the_least_error) {
  QualityPolicy policy;
  policy.finished(12 * kMs, 1.0);
  EXPECT_EQ(policy.choose(kRungs, 10 * kMs), 1U);  // not 2: dearer and worse
  EXPECT_EQ(policy.choose(kRungs, 6 * kMs), 3U);
  EXPECT_EQ(policy.choose(kRungs, 1 * kMs), 3U);  // nothing fits: the fastest
  EXPECT_EQ(policy.choose(kRungs, -1), 3U);
}

TEST(QualityPolicy, judges_by_what_full_quality_would_have_taken) {
  QualityPolicy policy;
  policy.finished(6 * kMs, 0.4);  // 15 ms at full quality
  EXPECT_EQ(policy.choose(kRungs, 15 * kMs), 1U);
  EXPECT_EQ(policy.choose(kRungs, 17 * kMs), 0U);
}

TEST(QualityPolicy, keeps_room_for_what_disturbed_a_frame_until_that_is_long_ago) {
  QualityPolicy policy;
  for (int i = 0; i < 20; ++i) policy.finished(8 * kMs, 1.0);
  EXPECT_EQ(policy.choose(kRungs, 12 * kMs), 0U);
  policy.finished(12 * kMs, 1.0);  // 4 ms late, for whatever reason
  for (int i = 0; i < 99; ++i) {
    EXPECT_NE(policy.choose(kRungs, 12 * kMs), 0U);
    policy.finished(8 * kMs, 1.0);
  }
  policy.finished(8 * kMs, 1.0);
  EXPECT_EQ(policy.choose(kRungs, 12 * kMs), 0U);
}

TEST(QualityPolicy, nearly_all_frames_of_a_noisy_machine_are_in_time) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(1.0, 0.08);
  QualityPolicy policy;
  int late = 0;
  constexpr int kFrames = 20'000;
  for (int i = 0; i < kFrames; ++i) {
    const std::size_t rung = policy.choose(kRungs, 10 * kMs);
    const auto work_ns =
        static_cast<std::int64_t>(1e6 * 11.0 * noise(random) * kRungs[rung].cost_frac);
    if (work_ns > 10 * kMs) ++late;
    policy.finished(work_ns, kRungs[rung].cost_frac);
  }
  EXPECT_LT(late, kFrames / 100);
}

}  // namespace
}  // namespace emit::server
