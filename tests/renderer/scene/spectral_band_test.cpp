// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "emit/physics/planck.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::scene {
namespace {

/// Photon radiance of a blackbody weighted with a response per photon, s-1 m-2 sr-1: Planck's law
/// for photons by the midpoint rule, with the constants written out here.
template <class Response>
double photon_radiance(double lo_um, double hi_um, double kelvin, const Response& response) {
  constexpr int kParts = 20'000;
  double sum = 0.0;
  for (int i = 0; i < kParts; ++i) {
    const double m = 1e-6 * (lo_um + (hi_um - lo_um) * (i + 0.5) / kParts);
    const double spectral =
        2.0 * 299792458.0 / (std::pow(m, 4) * std::expm1(0.01438776877 / (m * kelvin)));
    sum += spectral * response(1e6 * m) * 1e-6 * (hi_um - lo_um) / kParts;
  }
  return sum;
}

TEST(SpectralBand, RadianceOfAPhotonBandTimesPhotonsPerJouleIsPhotonRadiance) {
  SpectralBand flat{"flat", 3.0, 5.0, {}};
  flat.photons = true;
  // The response goes beyond the limits of the band on one side.
  SpectralBand curved{"curved", 7.5, 11.5, {{7.0, 0.0}, {8.0, 0.9}, {10.0, 1.0}, {11.5, 0.2}}};
  curved.photons = true;
  const auto curve = [](double um) {
    return um < 8.0    ? 0.9 * (um - 7.0)
           : um < 10.0 ? 0.9 + 0.05 * (um - 8.0)
                       : 1.0 - 0.8 * (um - 10.0) / 1.5;
  };
  // This one ends with full response within its limits, on both sides.
  SpectralBand inside{"inside", 3.0, 5.5, {{3.4, 1.0}, {5.0, 1.0}}};
  inside.photons = true;
  for (const double kelvin : {230.0, 300.0, 600.0, 2000.0}) {
    const auto of = [&](const SpectralBand& band) {
      return photons_per_joule(band) *
             physics::band_radiance(spectral_band(band), physics::Kelvin(kelvin)).radiance_w_m2_sr;
    };
    const double expected = photon_radiance(3.0, 5.0, kelvin, [](double) { return 1.0; });
    EXPECT_NEAR(of(flat) / expected, 1.0, 1e-6) << kelvin;
    EXPECT_NEAR(of(curved) / photon_radiance(7.5, 11.5, kelvin, curve), 1.0, 5e-5) << kelvin;
    const double within = photon_radiance(3.4, 5.0, kelvin, [](double) { return 1.0; });
    EXPECT_NEAR(of(inside) / within, 1.0, 1e-6) << kelvin;
  }
  for (const SpectralBand& band : {flat, curved, inside}) {
    EXPECT_TRUE(physics::validate(spectral_band(band)).has_value());
  }
}

TEST(SpectralBand, APowerBandKeepsItsResponse) {
  const SpectralBand band{"det", 3.0, 5.0, {{3.0, 0.5}, {4.0, 1.0}, {5.0, 0.25}}};
  const physics::Band made = spectral_band(band);
  ASSERT_EQ(made.response.size(), 3U);
  EXPECT_EQ(made.response[2].response_frac, 0.25);
  EXPECT_TRUE(spectral_band({"flat", 3.0, 5.0, {}}).response.empty());
}

}  // namespace
}  // namespace emit::scene
