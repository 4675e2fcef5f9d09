// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/planck.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "emit/physics/band_radiance_lut.hpp"

namespace emit::physics {
namespace {

TEST(Planck, WholeSpectrumIsStefanBoltzmann) {
  for (const double t : {200.0, 300.0, 1000.0, 5772.0}) {
    // The band 0.05..1000 um holds all but the long tail, which Rayleigh-Jeans closes: 2 c k T / (3
    // l^3).
    const Band all{0.05, 1000.0, {}};
    const double tail = 2.0 * kSpeedOfLightMPerS * kBoltzmannJPerK * t / (3.0 * 1e-9);
    const double total = band_radiance(all, Kelvin(t)).radiance_w_m2_sr + tail;
    const double expected = kStefanBoltzmannWPerM2K4 * t * t * t * t / kPi;
    // The first neglected term of the tail is a fraction 3 c2/(8 l T) of it.
    EXPECT_NEAR(total / expected, 1.0, 1e-9 + tail / expected * 0.03) << t;
  }
}

TEST(Planck, SpectralPeakFollowsWien) {
  for (const double t : {150.0, 300.0, 1200.0, 5772.0}) {
    const double peak_um = 2897.771955 / t;
    const auto at = [t](double um) {
      return spectral_radiance(Micrometres(um), Kelvin(t)).value();
    };
    EXPECT_GT(at(peak_um), at(peak_um * 1.001));
    EXPECT_GT(at(peak_um), at(peak_um * 0.999));
  }
}

TEST(Planck, NarrowBandIsSpectralRadianceTimesWidth) {
  const Band narrow{3.9995, 4.0005, {}};
  EXPECT_NEAR(band_radiance(narrow, 300_K).radiance_w_m2_sr,
              spectral_radiance(4_um, 300_K).value() * 0.001, 1e-9);
}

TEST(Planck, BandsAdd) {
  const double t = 750.0;
  const auto in = [t](double lo, double hi) {
    return band_radiance(Band{lo, hi, {}}, Kelvin(t)).radiance_w_m2_sr;
  };
  EXPECT_NEAR((in(3, 4) + in(4, 5)) / in(3, 5), 1.0, 1e-14);
}

TEST(Planck, DerivativeIsTheSlope) {
  const Band band{8.0, 12.0, {}};
  for (const double t : {80.0, 300.0, 2500.0}) {
    const double h = 1e-4 * t;
    const double slope = (band_radiance(band, Kelvin(t + h)).radiance_w_m2_sr -
                          band_radiance(band, Kelvin(t - h)).radiance_w_m2_sr) /
                         (2.0 * h);
    EXPECT_NEAR(band_radiance(band, Kelvin(t)).derivative_w_m2_sr_k / slope, 1.0, 1e-6);
  }
}

TEST(Planck, ResponseTableIsLinearBetweenItsPointsAndZeroOutside) {
  const Band flat{3.0, 5.0, {{2.0, 0.5}, {4.0, 0.5}, {6.0, 0.5}}};
  const Band plain{3.0, 5.0, {}};
  EXPECT_NEAR(band_radiance(flat, 300_K).radiance_w_m2_sr,
              0.5 * band_radiance(plain, 300_K).radiance_w_m2_sr, 1e-14);
  const Band part{1.0, 20.0, {{3.0, 1.0}, {5.0, 1.0}}};
  EXPECT_NEAR(band_radiance(part, 300_K).radiance_w_m2_sr,
              band_radiance(plain, 300_K).radiance_w_m2_sr, 1e-14);

  // Compare a triangle with a midpoint sum, also at 60 K, at which its foot carries the radiance.
  const Band triangle{3.0, 5.0, {{3.0, 0.0}, {4.5, 1.0}, {5.0, 0.0}}};
  for (const double t : {60.0, 300.0, 3000.0}) {
    const int n = 200000;
    double sum = 0.0;
    for (int i = 0; i < n; ++i) {
      const double um = 3.0 + 2.0 * (i + 0.5) / n;
      const double response = um < 4.5 ? (um - 3.0) / 1.5 : (5.0 - um) / 0.5;
      sum += response * spectral_radiance(Micrometres(um), Kelvin(t)).value() * 2.0 / n;
    }
    EXPECT_NEAR(band_radiance(triangle, Kelvin(t)).radiance_w_m2_sr / sum, 1.0, 1e-7) << t;
  }
}

TEST(Planck, LogarithmSurvivesUnderflow) {
  const BandRadiance cold = band_radiance(Band{3.0, 5.0, {}}, 3_K);
  EXPECT_EQ(cold.radiance_w_m2_sr, 0.0);
  EXPECT_NEAR(cold.log_radiance, std::log(5.381853359438383) - 415.0 * std::log(10.0), 1e-9);
}

TEST(Planck, NoTemperatureNoRadiance) {
  const Band band{3.0, 5.0, {}};
  EXPECT_EQ(band_radiance(band, 0_K).radiance_w_m2_sr, 0.0);
  EXPECT_EQ(band_radiance(band, Kelvin(-5.0)).radiance_w_m2_sr, 0.0);
  EXPECT_TRUE(std::isnan(band_radiance(band, Kelvin(std::nan(""))).radiance_w_m2_sr));
}

TEST(Planck, BrightnessTemperatureInvertsTheBand) {
  for (const Band& band : {Band{3.0, 5.0, {}}, Band{8.0, 12.0, {}},
                           Band{3.0, 5.0, {{3.0, 0.0}, {4.5, 1.0}, {5.0, 0.0}}}}) {
    for (double t = 5.0; t < 20000.0; t *= 1.3) {
      const double radiance = band_radiance(band, Kelvin(t)).radiance_w_m2_sr;
      if (radiance < 1e-280) continue;
      const auto inverse = brightness_temperature(band, Radiance(radiance));
      ASSERT_TRUE(inverse.has_value()) << t;
      EXPECT_NEAR(inverse->value() / t, 1.0, 1e-12);
    }
  }
  const Band band{8.0, 12.0, {}};
  EXPECT_FALSE(brightness_temperature(band, Radiance(0.0)).has_value());
  EXPECT_FALSE(brightness_temperature(band, Radiance(-1.0)).has_value());
  EXPECT_FALSE(brightness_temperature(band, Radiance(std::nan(""))).has_value());
  EXPECT_FALSE(brightness_temperature(band, Radiance(1e9)).has_value());
}

TEST(Planck, BandsThatMakeNoSenseAreRefusedWithTheReason) {
  const auto text = [](const Band& band) {
    const auto result = validate(band);
    return result ? std::string() : result.error().text;
  };
  EXPECT_THAT(text({5.0, 3.0, {}}), testing::HasSubstr("0 < lo < hi"));
  EXPECT_THAT(text({0.0, 3.0, {}}), testing::HasSubstr("0 < lo < hi"));
  EXPECT_THAT(text({std::nan(""), 3.0, {}}), testing::HasSubstr("0 < lo < hi"));
  EXPECT_THAT(text({3.0, 5.0, {{3.0, 1.0}}}), testing::HasSubstr("two points"));
  EXPECT_THAT(text({3.0, 5.0, {{3.0, 1.0}, {3.0, 0.5}}}), testing::HasSubstr("response point 2"));
  EXPECT_THAT(text({3.0, 5.0, {{3.0, 1.0}, {4.0, 1.5}}}), testing::HasSubstr("response point 2"));
  EXPECT_THAT(text({3.0, 5.0, {{6.0, 1.0}, {7.0, 1.0}}}), testing::HasSubstr("zero throughout"));
  EXPECT_EQ(text({3.0, 5.0, {{3.0, 0.0}, {4.0, 1.0}, {5.0, 0.0}}}), "");
}

TEST(BandRadianceLut, StaysWithinItsStatedErrorOver200To3000Kelvin) {
  for (const Band& band :
       {Band{3.0, 5.0, {}}, Band{3.4, 4.1, {}}, Band{8.0, 12.0, {}}, Band{7.7, 9.3, {}}}) {
    const auto lut = BandRadianceLut::build(band);
    ASSERT_TRUE(lut.has_value());
    double worst_frac = 0.0;
    double worst_below_400_k = 0.0;
    for (float t = 200.0F; t < 3000.0F; t *= 1.0003F) {
      const BandRadiance exact = band_radiance(band, Kelvin(static_cast<double>(t)));
      const auto found = lut->lookup(t);
      ASSERT_FALSE(found.clamped);
      const double miss =
          std::abs(static_cast<double>(found.radiance_w_m2_sr) - exact.radiance_w_m2_sr);
      worst_frac = std::max(worst_frac, miss / exact.radiance_w_m2_sr);
      if (t < 400.0F)
        worst_below_400_k = std::max(worst_below_400_k, miss / exact.derivative_w_m2_sr_k);
    }
    EXPECT_LE(worst_frac, 1e-5);
    EXPECT_LE(worst_below_400_k, 3e-4);
  }
}

TEST(BandRadianceLut, OutsideItsRangeItClampsAndSaysSo) {
  const Band band{8.0, 12.0, {}};
  const auto lut = BandRadianceLut::build(band, {200.0, 400.0, 512});
  ASSERT_TRUE(lut.has_value());
  const auto low = lut->lookup(100.0F);
  const auto high = lut->lookup(1000.0F);
  EXPECT_TRUE(low.clamped);
  EXPECT_TRUE(high.clamped);
  EXPECT_EQ(low.radiance_w_m2_sr, lut->lookup(200.0F).radiance_w_m2_sr);
  EXPECT_NEAR(static_cast<double>(high.radiance_w_m2_sr),
              band_radiance(band, 400_K).radiance_w_m2_sr, 1e-3);
  EXPECT_TRUE(lut->lookup(std::numeric_limits<float>::quiet_NaN()).clamped);
  EXPECT_FALSE(lut->lookup(200.0F).clamped);
}

TEST(BandRadianceLut, OptionsOutOfOrderAreRefused) {
  const Band band{8.0, 12.0, {}};
  EXPECT_FALSE(BandRadianceLut::build(band, {400.0, 200.0, 512}).has_value());
  EXPECT_FALSE(BandRadianceLut::build(band, {0.0, 200.0, 512}).has_value());
  EXPECT_FALSE(BandRadianceLut::build(band, {100.0, 200.0, 1}).has_value());
  EXPECT_FALSE(BandRadianceLut::build(Band{5.0, 3.0, {}}).has_value());
}

}  // namespace
}  // namespace emit::physics
