// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/optical_constants.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <vector>

#include "emit/physics/constants.hpp"

/// Reflectance of smooth surfaces against Fresnel's formulae in complex numbers and known values.
namespace emit::physics {
namespace {

/// Both polarisations by the complex angle of refraction.
double by_complex_angle(double n, double k, double cosine) {
  const std::complex<double> index(n, -k);
  const std::complex<double> sine = std::sqrt(1.0 - cosine * cosine) / index;
  const std::complex<double> inside = std::sqrt(1.0 - sine * sine);
  const auto s = (cosine - index * inside) / (cosine + index * inside);
  const auto p = (index * cosine - inside) / (index * cosine + inside);
  return 0.5 * (std::norm(s) + std::norm(p));
}

TEST(OpticalConstants, FresnelMeetsTheComplexFormula) {
  for (const auto& [n, k] : std::vector<std::pair<double, double>>{{1.33, 0.0},
                                                                   {1.153, 0.0968},
                                                                   {1.5, 0.0},
                                                                   {0.684, 0.543},
                                                                   {1.209, 1.232},
                                                                   {20.0, 40.0}}) {
    for (int i = 0; i <= 90; i += 5) {
      const double cosine = std::cos(i * kDegree);
      EXPECT_NEAR(fresnel_reflectance_frac(n, k, cosine), by_complex_angle(n, k, cosine), 1e-12)
          << n << ' ' << k << ' ' << i;
    }
  }
}

TEST(OpticalConstants, GrazingLightIsReflected) {
  EXPECT_DOUBLE_EQ(fresnel_reflectance_frac(1.33, 0.0, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(fresnel_reflectance_frac(1.2, 0.5, 0.0), 1.0);
}

// Total internal angles have no place here; Brewster's angle has no reflection of one polarisation.
TEST(OpticalConstants, BrewstersAngleLeavesHalf) {
  const double cosine = std::cos(std::atan(1.5));
  const double s = std::pow((cosine - std::sqrt(2.25 - 1.0 + cosine * cosine)) /
                                (cosine + std::sqrt(2.25 - 1.0 + cosine * cosine)),
                            2);
  EXPECT_NEAR(fresnel_reflectance_frac(1.5, 0.0, cosine), 0.5 * s, 1e-12);
}

TEST(OpticalConstants, TablesAreSoundAndHoldTheirSources) {
  for (const IndexTable table : {IndexTable::water, IndexTable::window_glass}) {
    EXPECT_TRUE(validate(optical_constants(table)));
  }
  // Hale and Querry 1973, table 1; Rubin 1985.
  const auto water = optical_constants(IndexTable::water);
  EXPECT_EQ(constants_at(water, 10.0).refractive_index, 1.218);
  EXPECT_EQ(constants_at(water, 11.0).extinction_index, 0.0968);
  EXPECT_EQ(constants_at(water, 4.0).refractive_index, 1.351);
  EXPECT_EQ(constants_at(optical_constants(IndexTable::window_glass), 10.0).refractive_index,
            1.707);
  EXPECT_EQ(constants_at(water, 1.0).refractive_index, 1.306) << "the ends are held";
}

TEST(OpticalConstants, FaultyTablesAreNamed) {
  EXPECT_FALSE(validate(std::span<const OpticalConstants>{}));
  const std::vector<OpticalConstants> twice{{3.0, 1.5, 0.0}, {3.0, 1.5, 0.0}};
  EXPECT_NE(validate(twice).error().text.find("wavelength 2"), std::string::npos);
  const std::vector<OpticalConstants> gain{{3.0, 1.5, -0.1}};
  EXPECT_NE(validate(gain).error().text.find("extinction index 1"), std::string::npos);
}

// EN 673 gives uncoated glass a normal emissivity of 0.89, corrected to 0.837 over the hemisphere,
// at 283 K.
TEST(OpticalConstants, WindowGlassHasTheEmissivityOfTheStandard) {
  const auto glass = optical_constants(IndexTable::window_glass);
  const Band all{5.0, 50.0, {}};
  const double normal = 1.0 - band_reflectance_frac(glass, all, Kelvin(283.0), 1.0);
  EXPECT_NEAR(normal, 0.89, 0.01);
  double hemispherical = 0.0;
  for (int i = 0; i < 200; ++i) {
    const double cosine = std::sqrt((i + 0.5) / 200);
    hemispherical += (1.0 - band_reflectance_frac(glass, all, Kelvin(283.0), cosine)) / 200;
  }
  EXPECT_NEAR(hemispherical, 0.837, 0.01);
}

}  // namespace
}  // namespace emit::physics
