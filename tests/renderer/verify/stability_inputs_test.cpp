// SPDX-License-Identifier: Apache-2.0
// Tests of the stability sweeps' inputs and of the counting of their results, on the CPU.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "shared/stability_inputs.glsl.h"
#include "stability/stability_tally.hpp"

namespace emit::verify {
namespace {

constexpr std::uint32_t kSeed = 7;
constexpr std::uint32_t kDraws = 40'000;

TEST(StabilityInputs, HighProductIsTheHighWord) {
  for (const std::uint32_t a : {0U, 1U, 0xFFFFU, 0x10000U, 0x12345678U, 0xFFFFFFFFU}) {
    for (const std::uint32_t b : {0U, 1U, 0xFFFFU, 0x10001U, 0x9ABCDEF0U, 0xFFFFFFFFU}) {
      EXPECT_EQ(inputs::high_product(a, b),
                static_cast<std::uint32_t>((std::uint64_t{a} * b) >> 32U));
    }
  }
}

TEST(StabilityInputs, BoxIsFilledToItsEdgesAndNotBeyond) {
  std::uint32_t edges = 0;
  std::uint32_t cold = 0;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const auto s = inputs::surface_input(kSeed, i, EMIT_DOMAIN_BOX);
    ASSERT_TRUE(s.conductivity_w_m_k >= 0.02F && s.conductivity_w_m_k <= 400.0F);
    ASSERT_TRUE(s.thickness_m >= 1e-4F && s.thickness_m <= 1.0F);
    ASSERT_TRUE(s.emissivity_frac >= 0.02F && s.emissivity_frac <= 1.0F);
    ASSERT_TRUE(s.radiative_k >= 0.0F && s.radiative_k <= 1000.0F);
    ASSERT_TRUE(s.core_k >= 200.0F && s.core_k <= 400.0F);
    ASSERT_EQ(s.film_w_m2_k, 0.0F);
    edges += s.core_k == 200.0F || s.core_k == 400.0F ? 1U : 0U;
    cold += s.core_k < 300.0F ? 1U : 0U;
  }
  EXPECT_NEAR(edges, 0.25 * kDraws, 0.01 * kDraws);
  EXPECT_NEAR(cold, 0.5 * kDraws, 0.01 * kDraws);
}

TEST(StabilityInputs, HostileSurfacesHoldEveryKindOfNonsense) {
  std::uint32_t nan = 0;
  std::uint32_t inf = 0;
  std::uint32_t negative = 0;
  std::uint32_t plain = 0;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const float v = inputs::surface_input(kSeed, i, EMIT_DOMAIN_HOSTILE).radiative_k;
    nan += std::isnan(v) ? 1U : 0U;
    inf += std::isinf(v) ? 1U : 0U;
    negative += v < 0.0F ? 1U : 0U;
    plain += v > 0.0F && v <= 6000.0F ? 1U : 0U;
  }
  EXPECT_GT(nan, kDraws / 100);
  EXPECT_GT(inf, kDraws / 100);
  EXPECT_GT(negative, kDraws / 50);
  EXPECT_GT(plain, kDraws / 3);
}

TEST(StabilityInputs, DriveIsExactAndWithin128Kelvin) {
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const float u = inputs::drive_offset_k(kSeed, 3, i);
    ASSERT_LE(std::abs(u), 128.0F);
    ASSERT_EQ(u * 16384.0F, std::round(u * 16384.0F));
  }
}

TEST(StabilityTally, CountsAndPercentilesOfKnownErrors) {
  Tally tally;
  for (std::uint32_t i = 1; i <= 1000; ++i) {
    const double error_k = 1e-6 * i;
    tally.add(300.0F, 300.0, error_k, error_k / 300.0, i);
  }
  tally.add(std::numeric_limits<float>::quiet_NaN(), 300.0, 1.0, 1.0, 2000);
  tally.add(-std::numeric_limits<float>::infinity(), 300.0, 1.0, 1.0, 2001);
  tally.add(-1.0F, 300.0, 5e-3, 1e-5, 2002);
  tally.add_flag(true, false);
  tally.add_flag(false, false);
  tally.add_flag(false, true);
  SweepResult row;
  tally.write(row);
  EXPECT_EQ(row.cases, 1003U);
  EXPECT_EQ(row.nan_count, 1U);
  EXPECT_EQ(row.inf_count, 1U);
  EXPECT_EQ(row.below_zero_count, 1U);
  EXPECT_EQ(row.clamped_count, 1U);
  EXPECT_EQ(row.unflagged_count, 1U);
  EXPECT_DOUBLE_EQ(row.max_error_k, 5e-3);
  EXPECT_EQ(tally.worst_case(), 2002U);
  EXPECT_GE(row.p99_error_k, 0.99e-3);
  EXPECT_LE(row.p99_error_k, 0.99e-3 * 1.13) << "classes are an eighth of a factor of two wide";
}

TEST(StabilityTally, ErrorsInKelvinThatDoNotApplyAreNoNumber) {
  Tally tally;
  tally.add(1e9F, 1e9, std::numeric_limits<double>::quiet_NaN(), 1e-7, 4);
  SweepResult row;
  tally.write(row);
  EXPECT_TRUE(std::isnan(row.max_error_k));
  EXPECT_TRUE(std::isnan(row.p99_error_k));
  EXPECT_DOUBLE_EQ(row.max_error_frac, 1e-7);
}

TEST(StabilityTally, MergingKeepsTheWorstWhicheverCameFirst) {
  Tally a;
  Tally b;
  a.add(1.0F, 1.0, 1e-3, 1e-3, 9);
  b.add(1.0F, 1.0, 2e-3, 2e-3, 5);
  Tally ab = a;
  ab.merge(b);
  b.merge(a);
  EXPECT_EQ(ab.worst_case(), 5U);
  EXPECT_EQ(b.worst_case(), 5U);
}

}  // namespace
}  // namespace emit::verify
