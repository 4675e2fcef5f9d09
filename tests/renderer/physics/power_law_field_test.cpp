// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/power_law_field.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

/// The field of clutter against Fourier sums by definition.
namespace emit::physics {
namespace {

constexpr std::size_t kSide = 128;
constexpr double kPeriodM = 64.0;
constexpr PowerLaw kLaw{
    .period_m = kPeriodM, .shortest_m = 2.0, .longest_m = 16.0, .slope = 3.0, .seed = 5};

double at(const FieldLevel& level, std::size_t x, std::size_t y) {
  return level.values[(y % level.side) * level.side + x % level.side];
}

/// Squared size of a Fourier coefficient of a field of variance 1, by definition.
double power(const FieldLevel& level, int waves_x, int waves_y) {
  std::complex<double> sum = 0.0;
  const auto n = static_cast<double>(level.side);
  for (std::size_t y = 0; y < level.side; ++y) {
    for (std::size_t x = 0; x < level.side; ++x) {
      const double turns =
          (waves_x * static_cast<double>(x) + waves_y * static_cast<double>(y)) / n;
      sum += at(level, x, y) * std::polar(1.0, -2.0 * std::numbers::pi * turns);
    }
  }
  return std::norm(sum / (n * n));
}

TEST(PowerLawField, HasMeanZeroAndVarianceOneAndIsNearlyGaussian) {
  const FieldLevel field = power_law_field(kLaw, kSide).front();
  double mean = 0.0;
  double square = 0.0;
  double fourth = 0.0;
  for (const float value : field.values) {
    mean += value;
    square += std::pow(value, 2);
    fourth += std::pow(value, 4);
  }
  const auto count = static_cast<double>(field.values.size());
  EXPECT_NEAR(mean / count, 0.0, 1e-6);
  EXPECT_NEAR(square / count, 1.0, 1e-5);
  EXPECT_NEAR(field.variance, 1.0, 1e-12);
  EXPECT_NEAR(fourth / count, 3.0, 0.7);
}

TEST(PowerLawField, SpectrumFollowsThePowerLawBetweenItsWavelengthsAndIsEmptyOutside) {
  const FieldLevel field = power_law_field(kLaw, kSide).front();
  // 16 m are 4 waves in the tile and 2 m are 32.
  const double first = power(field, 0, 5) * std::pow(5.0, 3.0);
  EXPECT_GT(first, 0.0);
  for (const auto& [x, y] : {std::pair{8, 0}, {3, 4}, {-6, 8}, {12, -5}, {20, 20}, {0, 31}}) {
    const double waves = std::hypot(x, y);
    EXPECT_NEAR(power(field, x, y) * std::pow(waves, 3.0), first, 2e-4 * first) << x << ' ' << y;
  }
  for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {2, 2}, {3, 0}, {33, 0}, {30, 30}, {60, 3}}) {
    EXPECT_LT(power(field, x, y), 1e-12) << x << ' ' << y;
  }
}

TEST(PowerLawField, LevelsKeepTheLongWavesAndLeaveTheShortOnesOut) {
  const auto levels = power_law_field(kLaw, kSide);
  ASSERT_EQ(levels.size(), 11U);
  const FieldLevel& field = levels.front();
  for (std::size_t l = 1; l < 8; ++l) {
    const FieldLevel& level = levels[l];
    ASSERT_EQ(level.side, (l % 2 == 0 ? kSide : kSide / 4 * 3) >> (l / 2));
    double variance = 0.0;
    for (const float value : level.values) variance += std::pow(value, 2);
    variance /= static_cast<double>(level.values.size());
    EXPECT_NEAR(variance, level.variance, 1e-5 + 1e-3 * level.variance) << l;
    EXPECT_LT(level.variance, levels[l - 1].variance);
    // Less and less is kept from 0.05 to 0.3 waves per texel.
    for (const auto& [x, y] : {std::pair{4, 1}, {0, 5}, {-3, 3}, {7, 2}, {12, 0}}) {
      const double turns_per_texel = std::hypot(x, y) / static_cast<double>(level.side);
      if (2 * std::max(std::abs(x), std::abs(y)) >= static_cast<int>(level.side)) continue;
      const double part = std::clamp((turns_per_texel - 0.05) / 0.25, 0.0, 1.0);
      const double kept = std::pow(std::cos(0.5 * std::numbers::pi * part), 4);
      const double whole = power(field, x, y);
      EXPECT_NEAR(power(level, x, y), kept * whole, 1e-3 * whole) << l;
    }
  }
  EXPECT_EQ(levels.back().side, 4U);
  EXPECT_LT(levels.back().variance, 1e-6);
}

TEST(PowerLawField, SeedsGiveFieldsThatDoNotCorrelate) {
  PowerLaw other = kLaw;
  other.seed = 6;
  const FieldLevel a = power_law_field(kLaw, kSide).front();
  const FieldLevel b = power_law_field(other, kSide).front();
  const FieldLevel again = power_law_field(kLaw, kSide).front();
  double product = 0.0;
  for (std::size_t i = 0; i < a.values.size(); ++i) product += a.values[i] * b.values[i];
  EXPECT_LT(std::abs(product) / static_cast<double>(a.values.size()), 0.2);
  EXPECT_EQ(a.values, again.values);
}

}  // namespace
}  // namespace emit::physics
