// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/emissivity_spectrum.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

using Spectrum = std::vector<EmissivityPoint>;

/// Share of a blackbody's radiance below a wavelength, by the series of Chang and Rhee (1984):
/// 15/pi^4 sum exp(-n x)/n (x^3 + 3 x^2/n + 6 x/n^2 + 6/n^3).
double share_below(double wavelength_um, double kelvin) {
  const double x = kC2UmK / (wavelength_um * kelvin);
  double sum = 0.0;
  for (int n = 1; n <= 400; ++n) {
    sum += std::exp(-n * x) / n * (x * x * x + 3.0 * x * x / n + 6.0 * x / n / n + 6.0 / n / n / n);
  }
  return 15.0 / std::pow(kPi, 4) * sum;
}

/// The series itself against the printed table of Siegel and Howell: F(0 to 2897.8 um K), F(5000).
TEST(EmissivityFold, the_series_of_this_test_is_that_of_the_tables) {
  EXPECT_NEAR(share_below(2897.8 / 300.0, 300.0), 0.2501, 1e-4);
  EXPECT_NEAR(share_below(5000.0 / 300.0, 300.0), 0.6337, 1e-4);
}

/// Mean by a midpoint sum over wavelength, which shares nothing with the quadrature.
double brute_mean(
    const Band& band, double kelvin, const std::function<double(double)>& eps,
    const std::function<double(double)>& passed = [](double) { return 1.0; }, int steps = 400'000) {
  double sum = 0.0;
  double weights = 0.0;
  for (int i = 0; i < steps; ++i) {
    const double um = band.lo_um + (band.hi_um - band.lo_um) * (i + 0.5) / steps;
    const double weight = response_frac(band, um) * passed(um) /
                          (std::pow(um, 5) * std::expm1(kC2UmK / (um * kelvin)));
    sum += weight * eps(um);
    weights += weight;
  }
  return sum / weights;
}

/// Emissivity 1 up to a wavelength, and 0 beyond it.
Spectrum step_at(double um) {
  return {{2.0, 1.0}, {um * (1.0 - 1e-12), 1.0}, {um * (1.0 + 1e-12), 0.0}, {50.0, 0.0}};
}

const Band kLwir{8.0, 12.0, {}};
const Band kMwir{3.0, 5.0, {}};
const Band kBell{7.5, 13.0, {{7.5, 0.0}, {8.4, 0.6}, {10.0, 1.0}, {13.0, 0.1}}};

SpectralAir level_air(double range_m) {
  const auto column = AirColumn::build({});
  return SpectralAir(AirPath::between(*column, 100.0, 100.0, range_m));
}

TEST(EmissivityFold, a_grey_spectrum_gives_its_value) {
  for (const Band& band : {kLwir, kMwir, kBell}) {
    for (const double kelvin : {200.0, 300.0, 1500.0}) {
      for (const SpectralAir& air : {SpectralAir(), level_air(2000.0)}) {
        const auto folded = EmissivityFold(Spectrum{{2.0, 0.83}, {20.0, 0.83}}, band, Kelvin(200.0))
                                .at(Kelvin(kelvin), air);
        EXPECT_NEAR(folded.emissivity_frac, 0.83, 1e-14);
        EXPECT_EQ(folded.beyond_frac, 0.0);
      }
    }
  }
}

TEST(EmissivityFold, a_step_gives_the_share_of_a_blackbody_below_it) {
  struct Case {
    Band band;
    double step_um;
  };
  for (const auto& [band, step_um] : {Case{kLwir, 10.0}, Case{kMwir, 4.0}}) {
    const EmissivityFold fold(step_at(step_um), band, Kelvin(250.0));
    for (const double kelvin : {250.0, 300.0, 350.0, 900.0}) {
      const double low = share_below(band.lo_um, kelvin);
      const double expected =
          (share_below(step_um, kelvin) - low) / (share_below(band.hi_um, kelvin) - low);
      EXPECT_NEAR(fold.at(Kelvin(kelvin)).emissivity_frac, expected, 1e-9) << kelvin;
    }
  }
}

TEST(EmissivityFold, linear_spectra_and_responses_are_those_of_a_fine_sum) {
  const Spectrum bent{{7.0, 0.95}, {9.0, 0.6}, {9.5, 0.7}, {14.0, 0.98}};
  const auto eps = [&](double um) {
    if (um < 9.0) return 0.95 + (um - 7.0) / 2.0 * (0.6 - 0.95);
    if (um < 9.5) return 0.6 + (um - 9.0) / 0.5 * 0.1;
    return 0.7 + (um - 9.5) / 4.5 * 0.28;
  };
  for (const Band& band : {kLwir, kBell}) {
    const EmissivityFold fold(bent, band, Kelvin(250.0));
    for (const double kelvin : {250.0, 300.0, 700.0}) {
      EXPECT_NEAR(fold.at(Kelvin(kelvin)).emissivity_frac, brute_mean(band, kelvin, eps), 1e-9);
    }
    EXPECT_NEAR(fold.black_w_m2_sr(Kelvin(300.0)),
                band_radiance(band, Kelvin(300.0)).radiance_w_m2_sr, 1e-9);
  }
}

TEST(EmissivityFold, the_ends_of_the_spectrum_hold_beyond_it) {
  const EmissivityFold fold(Spectrum{{6.0, 0.5}, {10.0, 0.5}}, kLwir, Kelvin(300.0));
  const double low = share_below(8.0, 300.0);
  const auto folded = fold.at(Kelvin(300.0));
  EXPECT_NEAR(folded.emissivity_frac, 0.5, 1e-14);
  EXPECT_NEAR(folded.beyond_frac,
              1.0 - (share_below(10.0, 300.0) - low) / (share_below(12.0, 300.0) - low), 1e-9);
  const EmissivityFold nothing(Spectrum{{6.0, 0.5}, {7.0, 0.5}}, kLwir, Kelvin(300.0));
  EXPECT_EQ(nothing.at(Kelvin(300.0)).beyond_frac, 1.0);
}

/// The air's pieces are those that bands of any shape are made of.
TEST(SpectralAir, passes_what_the_air_of_the_band_passes) {
  const auto column = AirColumn::build({});
  const Band filter{3.1, 4.9, {{3.1, 0.2}, {3.6, 0.9}, {4.4, 0.7}, {4.9, 0.0}}};
  for (const Band& band : {filter, kBell}) {
    const auto own = BandAir::build(band);
    ASSERT_TRUE(own.has_value());
    const EmissivityFold fold(Spectrum{{2.0, 1.0}, {20.0, 1.0}}, band, Kelvin(300.0));
    for (const double range_m : {100.0, 1000.0, 5000.0}) {
      const AirPath path = AirPath::between(*column, 100.0, 100.0, range_m);
      EXPECT_NEAR(
          fold.black_w_m2_sr(Kelvin(300.0), SpectralAir(path)) / fold.black_w_m2_sr(Kelvin(300.0)),
          own->transmittance(path, AirSource::black_300k), 1e-9);
    }
  }
  const AirPath up = AirPath::to_space(*column, 100.0, 0.8);
  const SpectralAir behind = SpectralAir(up).behind(level_air(1000.0));
  for (const double um : {3.9, 4.26, 10.0}) {
    EXPECT_NEAR(behind.transmittance_frac(um),
                SpectralAir(up).transmittance_frac(um) * level_air(1000.0).transmittance_frac(um),
                1e-15);
  }
  EXPECT_EQ(level_air(1000.0).transmittance_frac(1.9), 1.0) << "no air is known there";
  EXPECT_EQ(level_air(1000.0).transmittance_frac(20.0), 1.0);
}

TEST(EmissivityFold, light_that_the_air_takes_does_not_count) {
  // A material that emits in the band of carbon dioxide alone is dark behind a kilometre of air.
  const Spectrum in_dioxide{{2.0, 0.1}, {4.2, 0.1}, {4.21, 0.9}, {4.35, 0.9}, {4.36, 0.1}};
  const auto eps = [](double um) {
    if (um < 4.2 || um > 4.36) return 0.1;
    if (um > 4.21 && um < 4.35) return 0.9;
    return um < 4.3 ? 0.1 + (um - 4.2) / 0.01 * 0.8 : 0.9 - (um - 4.35) / 0.01 * 0.8;
  };
  const EmissivityFold fold(in_dioxide, kMwir, Kelvin(250.0));
  const SpectralAir air = level_air(1000.0);
  const double without = fold.at(Kelvin(300.0)).emissivity_frac;
  const double behind = fold.at(Kelvin(300.0), air).emissivity_frac;
  EXPECT_NEAR(without, brute_mean(kMwir, 300.0, eps), 1e-7);
  // The sum steps over the edges of the air's pieces, so it has to be finer.
  const auto passed = [&](double um) { return air.transmittance_frac(um); };
  EXPECT_NEAR(behind, brute_mean(kMwir, 300.0, eps, passed, 8'000'000), 1e-7);
  EXPECT_GT(without, 0.15);
  EXPECT_LT(behind, 0.11);
}

TEST(EmissivityFold, the_total_emissivity_is_the_mean_over_a_blackbody) {
  for (const double kelvin : {300.0, 1000.0}) {
    const auto total = total_emissivity(step_at(10.0), Kelvin(kelvin));
    EXPECT_NEAR(total.emissivity_frac, share_below(10.0, kelvin), 1e-7);
    EXPECT_NEAR(total.beyond_frac, share_below(2.0, kelvin) + 1.0 - share_below(50.0, kelvin),
                1e-7);
  }
}

TEST(EmissivityFold, the_apparent_temperature_inverts_the_radiance) {
  const EmissivityFold fold(Spectrum{{2.0, 1.0}, {20.0, 1.0}}, kBell, Kelvin(250.0));
  for (const double kelvin : {120.0, 250.0, 300.0, 900.0}) {
    const double radiance = fold.black_w_m2_sr(Kelvin(kelvin));
    EXPECT_NEAR(fold.apparent(radiance, Kelvin(300.0)).value(), kelvin, 1e-5);
  }
  EXPECT_EQ(fold.apparent(0.0, Kelvin(300.0)).value(), 0.0);
}

/// The errors by the blackbodies of both halves of a band, without the fold.
TEST(EmissivityErrors, are_those_of_a_step_by_its_two_halves) {
  const Band left{8.0, 10.0, {}};
  const auto radiance = [](const Band& band, double kelvin) {
    return band_radiance(band, Kelvin(kelvin)).radiance_w_m2_sr;
  };
  const auto shown_k = [](double w_m2_sr) {
    return brightness_temperature(kLwir, Radiance(w_m2_sr))->value();
  };
  const double folded = radiance(left, 300.0) / radiance(kLwir, 300.0);
  double worst_k = 0.0;
  for (int i = 0; i <= 8; ++i) {
    const double kelvin = 250.0 + 12.5 * i;
    worst_k = std::max(worst_k, std::abs(shown_k(radiance(left, kelvin)) -
                                         shown_k(folded * radiance(kLwir, kelvin))));
  }
  const double sine = std::sin(kSunSemiAngleRad);
  const double reflected = radiance(kLwir, 300.0) * folded;
  const double given = reflected + (1.0 - folded) * sine * sine * radiance(kLwir, 5772.0);
  const double truth = reflected + sine * sine * (radiance(kLwir, 5772.0) - radiance(left, 5772.0));

  const EmissivityFold fold(step_at(10.0), kLwir, Kelvin(250.0));
  const EmissivityErrors errors =
      emissivity_errors(fold, folded, {Kelvin(300.0), Kelvin(250.0), Kelvin(350.0)}, {});
  EXPECT_NEAR(errors.temperature_k, worst_k, 1e-4);
  EXPECT_NEAR(errors.largest_k, worst_k, 1e-4);
  EXPECT_NEAR(errors.air_k, 0.0, 1e-6);
  EXPECT_NEAR(errors.sunlight_k, std::abs(shown_k(given) - shown_k(truth)), 1e-4);
  EXPECT_GT(worst_k, 1.0);
}

TEST(EmissivityErrors, a_grey_surface_has_none_and_air_makes_some_of_another) {
  const JudgedRange range{Kelvin(300.0), Kelvin(250.0), Kelvin(350.0)};
  const auto column = AirColumn::build({});
  const JudgedAir air{level_air(1000.0), level_air(5000.0),
                      SpectralAir(AirPath::to_space(*column, 100.0, 0.8))};
  const EmissivityFold grey(Spectrum{{2.0, 0.9}, {20.0, 0.9}}, kMwir, Kelvin(250.0));
  const EmissivityErrors none = emissivity_errors(grey, 0.9, range, air);
  for (const double error_k : {none.temperature_k, none.air_k, none.largest_k, none.sunlight_k}) {
    EXPECT_NEAR(error_k, 0.0, 1e-5);
  }
  const EmissivityFold slope(Spectrum{{3.0, 0.6}, {5.0, 1.0}}, kMwir, Kelvin(250.0));
  const double folded = slope.at(Kelvin(300.0), air.folded).emissivity_frac;
  const EmissivityErrors some = emissivity_errors(slope, folded, range, air);
  double air_k = 0.0;
  const double black = band_radiance(kMwir, Kelvin(300.0)).radiance_w_m2_sr;
  for (const SpectralAir& path : {SpectralAir(), air.longest}) {
    const auto eps = [](double um) { return 0.6 + 0.2 * (um - 3.0); };
    const auto tau = [&](double um) { return path.transmittance_frac(um); };
    const double passed = brute_mean(kMwir, 300.0, tau);
    const auto shown_k = [&](double emissivity_frac) {
      const Radiance seen(black * (1.0 - passed + emissivity_frac * passed));
      return brightness_temperature(kMwir, seen)->value();
    };
    air_k =
        std::max(air_k, std::abs(shown_k(folded) - shown_k(brute_mean(kMwir, 300.0, eps, tau))));
  }
  EXPECT_NEAR(some.air_k, air_k, 2e-4);
  EXPECT_GT(some.air_k, 0.05);
  EXPECT_GE(some.largest_k, std::max(some.air_k, some.temperature_k));
}

}  // namespace
}  // namespace emit::physics
