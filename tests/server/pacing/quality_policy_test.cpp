// SPDX-License-Identifier: Apache-2.0
#include "pacing/quality_policy.hpp"
#include "support/times.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace emit::server {
namespace {

constexpr std::array<renderer::QualityLevelStats, 4> kQualityLevels{
    {{10.0, 0.0}, {7.0, 0.2}, {7.5, 0.3}, {4.0, 2.0}}};
using emit::test::kMs;

/// Runs frames until the policy has no doubt: wrong costs from the start are forgotten.
void settle(QualityPolicy& policy, double level_ms, double work_ms) {
  for (int i = 0; i < 600; ++i) policy.finished(std::llround(1e6 * work_ms), level_ms);
}

TEST(QualityPolicy, the_first_frame_goes_by_what_the_ladder_measured) {
  const QualityPolicy policy;
  EXPECT_EQ(policy.choose(kQualityLevels, 11 * kMs), 0U);
  EXPECT_EQ(policy.choose(kQualityLevels, 8 * kMs), 1U);  // not 2: dearer and worse
  EXPECT_EQ(policy.choose(kQualityLevels, 6 * kMs), 3U);
  EXPECT_EQ(policy.choose(kQualityLevels, 1 * kMs), 3U);  // nothing fits: the fastest
  EXPECT_EQ(policy.choose(kQualityLevels, -1), 3U);
}

TEST(QualityPolicy, gives_no_quality_away_where_every_level_takes_about_the_same_time) {
  // The frames of a fast device wait for the processor, whatever the level is.
  constexpr std::array<renderer::QualityLevelStats, 4> kAlike{
      {{2.6, 0.0}, {2.55, 0.2}, {2.5, 0.3}, {2.4, 2.0}}};
  QualityPolicy policy;
  EXPECT_EQ(policy.choose(kAlike, 1 * kMs), 0U);
  for (std::size_t i = 0; i < 600; ++i) {
    policy.finished(std::llround(2.5e6), kAlike[i % 4].frame_ms);
  }
  EXPECT_EQ(policy.choose(kAlike, 1 * kMs), 0U);
  // A level that is faster by more than a tenth is worth its error.
  constexpr std::array<renderer::QualityLevelStats, 3> kOneFaster{
      {{2.6, 0.0}, {1.9, 0.2}, {1.8, 2.0}}};
  EXPECT_EQ(QualityPolicy().choose(kOneFaster, 1 * kMs), 1U);
}

TEST(QualityPolicy, without_measured_times_there_is_nothing_to_shed) {
  constexpr std::array<renderer::QualityLevelStats, 1> kFullOnly{};
  QualityPolicy policy;
  for (int i = 0; i < 5; ++i) policy.finished(50 * kMs, 0.0);
  EXPECT_EQ(policy.choose(kFullOnly, 1 * kMs), 0U);
}

TEST(QualityPolicy, follows_the_pace_of_the_machine) {
  QualityPolicy policy;
  for (int i = 0; i < 600; ++i) {  // half as long again as when it was measured
    policy.finished(6 * kMs, 4.0);
    policy.finished(15 * kMs, 10.0);
  }
  EXPECT_EQ(policy.choose(kQualityLevels, 15 * kMs), 1U);
  EXPECT_EQ(policy.choose(kQualityLevels, 17 * kMs), 0U);
}

TEST(QualityPolicy, tells_what_every_frame_takes_beside_from_what_quality_levels_take) {
  QualityPolicy policy;
  for (int i = 0; i < 600; ++i) {  // 3 ms beside each
    policy.finished(7 * kMs, 4.0);
    policy.finished(13 * kMs, 10.0);
  }
  EXPECT_EQ(policy.choose(kQualityLevels, 12 * kMs), 1U);  // 10 ms of it
  EXPECT_EQ(policy.choose(kQualityLevels, 15 * kMs), 0U);
  EXPECT_EQ(policy.choose(kQualityLevels, 10 * kMs), 3U);
}

TEST(QualityPolicy, a_place_that_costs_more_is_foreseen) {
  QualityPolicy policy;
  settle(policy, 10.0, 10.0);
  std::array<renderer::QualityLevelStats, 4> dear = kQualityLevels;
  for (auto& quality_level : dear) quality_level.frame_ms *= 2.0;
  EXPECT_EQ(policy.choose(kQualityLevels, 12 * kMs), 0U);
  EXPECT_EQ(policy.choose(dear, 12 * kMs), 3U);
}

TEST(QualityPolicy, while_it_knows_little_keeps_room_for_all_that_disturbed_a_frame) {
  QualityPolicy policy;
  for (int i = 0; i < 50; ++i) policy.finished(8 * kMs, 10.0);
  EXPECT_EQ(policy.choose(kQualityLevels, 12 * kMs), 0U);
  policy.finished(12 * kMs, 10.0);  // 4 ms late, for whatever reason
  for (int i = 0; i < 50; ++i) {
    EXPECT_NE(policy.choose(kQualityLevels, 12 * kMs), 0U);
    policy.finished(8 * kMs, 10.0);
  }
}

TEST(QualityPolicy, what_disturbs_less_than_one_frame_in_128_costs_no_quality) {
  QualityPolicy policy;
  settle(policy, 10.0, 8.0);
  for (int i = 0; i < 2000; ++i) {
    const bool disturbed = i % 200 == 0;
    // The change does not come at once, because the machine's pace is in doubt for some frames.
    if (i % 200 > 60) {
      EXPECT_EQ(policy.choose(kQualityLevels, 12 * kMs), 0U) << i;
    }
    policy.finished((disturbed ? 14 : 8) * kMs, 10.0);
  }
}

TEST(QualityPolicy, keeps_room_for_what_disturbs_one_frame_in_fifty_until_that_is_long_ago) {
  QualityPolicy policy;
  settle(policy, 10.0, 8.0);
  for (int i = 0; i < 500; ++i) policy.finished((i % 50 == 0 ? 12 : 8) * kMs, 10.0);
  for (int i = 0; i < 60; ++i) {
    EXPECT_NE(policy.choose(kQualityLevels, 12 * kMs), 0U);
    policy.finished(8 * kMs, 10.0);
  }
  for (int i = 0; i < 70; ++i) policy.finished(8 * kMs, 10.0);
  EXPECT_EQ(policy.choose(kQualityLevels, 12 * kMs), 0U);
}

TEST(QualityPolicy, nearly_all_frames_of_a_noisy_machine_are_in_time) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(1.0, 0.08);
  QualityPolicy policy;
  int late = 0;
  constexpr int kFrames = 20'000;
  for (int i = 0; i < kFrames; ++i) {
    const std::size_t quality_level = policy.choose(kQualityLevels, 10 * kMs);
    const auto work_ns = static_cast<std::int64_t>(1e6 * 1.1 * noise(random) *
                                                   kQualityLevels[quality_level].frame_ms);
    if (work_ns > 10 * kMs) ++late;
    policy.finished(work_ns, kQualityLevels[quality_level].frame_ms);
  }
  EXPECT_LT(late, kFrames / 100);
}

}  // namespace
}  // namespace emit::server
