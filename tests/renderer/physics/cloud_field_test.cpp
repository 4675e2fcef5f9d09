// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "emit/physics/constants.hpp"
#include "emit/physics/sky/cloud_field.hpp"
#include "emit/physics/sky_state.hpp"

/// Broken clouds against closed forms: cover, drift, the place of a shadow, and means.
namespace emit::physics {
namespace {

constexpr std::int64_t kCloudSecondNs = 1'000'000'000;

Clouds fair_weather(double cover_frac) {
  Clouds clouds;
  clouds.cover_frac = cover_frac;
  clouds.drift_m_s = std::hypot(8.0, 5.0);
  clouds.drift_from_rad = std::atan2(-8.0, 5.0);
  return clouds;
}

SunPosition sun_at_elevation(double elevation_deg) {
  SunPosition sun;
  sun.elevation = degrees(elevation_deg);
  sun.direction_enu = {0.6 * std::cos(elevation_deg * kDegree),
                       0.8 * std::cos(elevation_deg * kDegree), std::sin(elevation_deg * kDegree)};
  return sun;
}

TEST(CloudField, CoversTheShareThatIsAskedForAtEveryScale) {
  for (const double cover : {0.1, 0.4, 0.85}) {
    const CloudField field(fair_weather(cover));
    EXPECT_NEAR(field.mean_frac(), cover, 1e-4);
    // Random places say the same within the error of their number; half a cloud is rare.
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> place(-40.0, 40.0);
    double sum = 0.0;
    int whole = 0;
    constexpr int kPlaces = 40000;
    for (int i = 0; i < kPlaces; ++i) {
      const double opacity = field.opacity_frac({place(random), place(random)}, 0.0);
      sum += opacity;
      whole += opacity < 0.05 || opacity > 0.95 ? 1 : 0;
    }
    EXPECT_NEAR(sum / kPlaces, cover, 0.01);
    EXPECT_GT(whole, kPlaces * 7 / 10);
    for (const double width : {0.003, 0.02, 0.1, 0.5}) {
      double wide = 0.0;
      for (int i = 0; i < kPlaces; ++i) {
        wide += field.opacity_frac({place(random), place(random)}, width);
      }
      EXPECT_NEAR(wide / kPlaces, cover, 0.01) << width;
    }
    EXPECT_NEAR(field.opacity_frac({0.3, 0.7}, 1.0), cover, 1e-4);
  }
}

TEST(CloudField, DriftsWithTheWindAndDoesNotChange) {
  const CloudField field(fair_weather(0.4));
  const glm::dvec2 drift_m_s(8.0, -5.0);
  for (const double seconds : {1.0, 37.0, 5400.0, -86400.0, 1e6}) {
    const auto time_ns = static_cast<std::int64_t>(seconds * 1e9);
    for (const glm::dvec2& at_m : {glm::dvec2(12.0, -30.0), glm::dvec2(-5000.0, 800.0)}) {
      EXPECT_NEAR(field.opacity_frac(field.tile_at(at_m + seconds * drift_m_s, time_ns), 0.0),
                  field.opacity_frac(field.tile_at(at_m, 0), 0.0), 1e-6);
    }
  }
  // The same settings give the same clouds, another seed other ones.
  const CloudField again(fair_weather(0.4));
  Clouds other = fair_weather(0.4);
  other.seed = 2;
  const CloudField others(other);
  double off = 0.0;
  for (int i = 0; i < 100; ++i) {
    const glm::dvec2 tile(0.017 * i, 0.029 * i);
    EXPECT_EQ(field.opacity_frac(tile, 0.001), again.opacity_frac(tile, 0.001));
    off += std::abs(field.opacity_frac(tile, 0.001) - others.opacity_frac(tile, 0.001)) / 100.0;
  }
  EXPECT_GT(off, 0.2);
}

TEST(CloudField, RaysMeetTheLayerAtTheCotangentOfTheirElevation) {
  for (const double elevation_deg : {20.0, 45.0, 70.0}) {
    const SunPosition sun = sun_at_elevation(elevation_deg);
    const glm::dvec2 met_m = cloud_crossing_m(1500.0, sun.direction_enu);
    const double away_m = 1500.0 / std::tan(elevation_deg * kDegree);
    // The Earth falls away under the ray by the square of the distance over its diameter.
    const double fall_m = away_m * away_m / (2.0 * kCloudEarthRadiusM);
    EXPECT_NEAR(glm::length(met_m), away_m, 2.0 * fall_m / std::tan(elevation_deg * kDegree) + 0.1);
    EXPECT_NEAR(met_m.x / met_m.y, 0.75, 1e-9);
  }
  // The horizon of a layer lies at sqrt(2 R h).
  EXPECT_NEAR(cloud_range_m(1500.0, 0.0), std::sqrt(2.0 * kCloudEarthRadiusM * 1500.0), 20.0);
  // Both forms of the root meet at the horizon.
  EXPECT_NEAR(cloud_range_m(1500.0, 1e-9), cloud_range_m(1500.0, -1e-9), 0.1);
}

TEST(CloudField, TheMeanOfTheDirectSunIsThatOfTheWeather) {
  const GeoPlace place{degrees(48.0), degrees(11.0), Metres(400.0)};
  const CloudField field(fair_weather(0.4));
  const SunPosition sun = sun_at_elevation(40.0);
  const double clear_w_m2 = clear_sky_irradiance(sun, place.height, 3.5).direct_normal_w_m2;
  for (const double share : {0.05, 0.5, 0.64, 0.9, 1.1}) {
    Forcing forcing;
    forcing.direct_normal_w_m2 = share * clear_w_m2;
    const CloudLight light = field.light(forcing, sun, place, 3.5);
    EXPECT_NEAR(light.by_mean(field.mean_frac()), 1.0, 1e-12) << share;
    const double between_w_m2 = light.by_mean(0.0) * share * clear_w_m2;
    const double under_w_m2 = light.by_mean(1.0) * share * clear_w_m2;
    EXPECT_LE(between_w_m2, std::max(1.0, share) * clear_w_m2 * (1.0 + 1e-12));
    EXPECT_GE(under_w_m2, -1e-9);
    // A cloud passes what it is said to, as long as the limit does not bite.
    if (share <= 0.64) {
      EXPECT_NEAR(under_w_m2, 0.1 * between_w_m2, 0.01 * between_w_m2);
    }
  }
  // The models of the clear sky give their own beam between the clouds.
  ClearSky model;
  model.cloud_frac = 0.4;
  model.cloud_transmission_frac = 0.1;
  const std::int64_t noon_ns = 1'403'344'800 * kCloudSecondNs;
  const SunPosition noon = sun_position(noon_ns, place);
  const Forcing forcing = forcing_from_clear_sky(model, place, noon, noon_ns);
  const CloudLight light = field.light(forcing, noon, place, model.linke_turbidity);
  EXPECT_NEAR(light.by_mean(0.0) * forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac),
              clear_sky_irradiance(noon, place.height, 3.5).direct_normal_w_m2, 0.1);
}

TEST(SkyOfCover, SendsTheIrradianceOfTheWeather) {
  for (const double cover : {0.1, 0.5, 0.9}) {
    for (const double longwave_w_m2 : {220.0, 300.0, 340.0, 420.0}) {
      const SkyState sky = sky_of_cover(longwave_w_m2, 288.0, 279.0, cover, {.height_m = 1200.0});
      const double clear = sky_longwave_w_m2(Kelvin(288.0), Kelvin(279.0), 0.0) *
                           std::pow((288.0 + sky.warmer_k) / 288.0, 4.0);
      const double sum =
          (1.0 - cover) * clear + cover * kStefanBoltzmannWPerM2K4 * std::pow(sky.cloud_k, 4.0);
      EXPECT_NEAR(sum, longwave_w_m2, 1e-6 * longwave_w_m2);
      EXPECT_EQ(sky.cloud_cover_frac, cover);
    }
  }
}

}  // namespace
}  // namespace emit::physics
