// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/sky_state.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "support/times.hpp"

namespace emit::physics {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kDay = 86400 * kSecondNs;

SunPosition sun_at_zenith_angle(double zenith_deg) {
  SunPosition sun;
  sun.elevation = degrees(90.0 - zenith_deg);
  sun.direction_enu = {std::sin(zenith_deg * kDegree), 0.0, std::cos(zenith_deg * kDegree)};
  return sun;
}

TEST(Sun, JulianDaysOfKnownDates) {
  EXPECT_EQ(julian_day_0h(2000, 1, 1), 2451544.5);
  EXPECT_EQ(julian_day_0h(1970, 1, 1), 2440587.5);
  EXPECT_EQ(julian_day_0h(2024, 2, 29) + 1.0, julian_day_0h(2024, 3, 1));
  EXPECT_EQ(julian_day_0h(1900, 2, 28) + 1.0, julian_day_0h(1900, 3, 1));
  EXPECT_EQ(julian_day_0h(1600, 2, 29) + 1.0, julian_day_0h(1600, 3, 1));
}

TEST(Sun, PosixTimeAgreesWithTheJulianDate) {
  const GeoPlace place{48.56_deg, 11.26_deg, 400_m};
  // The instants are 2003-10-17 19:30:30 UTC and 1955-06-05 12:00 UTC, which is before the POSIX
  // epoch.
  const SunPosition a = sun_position(1066419030 * kSecondNs, place);
  const SunPosition b = sun_position_ut1(julian_day_0h(2003, 10, 17), (19.5 * 3600 + 30) / 86400,
                                         delta_t_s(2003.8), place);
  EXPECT_LT(glm::distance(a.direction_enu, b.direction_enu), 1e-8);
  const auto days = static_cast<std::int64_t>(julian_day_0h(1955, 6, 5) - 2440587.5);
  const SunPosition c = sun_position(days * kDay + kDay / 2, place);
  const SunPosition d = sun_position_ut1(julian_day_0h(1955, 6, 5), 0.5, delta_t_s(1955.4), place);
  EXPECT_LT(glm::distance(c.direction_enu, d.direction_enu), 1e-8);
}

TEST(Sun, DirectionIsAUnitVectorOfAzimuthAndElevation) {
  const GeoPlace place{Radians(-0.6), Radians(2.4), 30_m};
  for (int hour = 0; hour < 24; ++hour) {
    const SunPosition sun = sun_position(1750000000 * kSecondNs + hour * 3600 * kSecondNs, place);
    EXPECT_NEAR(glm::length(sun.direction_enu), 1.0, 1e-14);
    const double ce = std::cos(sun.elevation.value());
    EXPECT_NEAR(sun.direction_enu.x, ce * std::sin(sun.azimuth.value()), 1e-12);
    EXPECT_NEAR(sun.direction_enu.y, ce * std::cos(sun.azimuth.value()), 1e-12);
    EXPECT_NEAR(sun.direction_enu.z, std::sin(sun.elevation.value()), 1e-12);
    EXPECT_GE(sun.azimuth.value(), 0.0);
    EXPECT_LT(sun.azimuth.value(), 2.0 * kPi);
  }
}

TEST(Sun, CulminatesInTheSouthOfTheNorthernTemperateZone) {
  const GeoPlace place{48.56_deg, 11.26_deg, 400_m};
  double highest = -1.0;
  double azimuth_deg = 0.0;
  // The sun of the solstice 2026-06-21 stands at 90 - 48.56 + 23.44 deg.
  for (std::int64_t minute = 0; minute < 1440; ++minute) {
    const SunPosition sun = sun_position(1781999999LL * kSecondNs + minute * 60 * kSecondNs, place);
    if (sun.elevation.value() > highest) {
      highest = sun.elevation.value();
      azimuth_deg = to_degrees(sun.azimuth);
    }
  }
  EXPECT_NEAR(highest / kDegree, 64.88, 0.02);
  EXPECT_NEAR(azimuth_deg, 180.0, 0.5);
}

TEST(Sun, DeltaTIsContinuousAndNearTheObservedValues) {
  for (const double year : {1941.0, 1961.0, 1986.0, 2005.0, 2020.0, 2030.0}) {
    EXPECT_NEAR(delta_t_s(year - 1e-9), delta_t_s(year), 0.5) << year;
  }
  EXPECT_NEAR(delta_t_s(1972.0), 42.23, 0.5);
  EXPECT_NEAR(delta_t_s(2000.0), 63.83, 0.2);
  EXPECT_NEAR(delta_t_s(2017.0), 68.6, 1.0);
}

TEST(Sun, MeanSolarTimeFollowsTheLongitude) {
  EXPECT_NEAR(mean_solar_hours(0, Radians(0.0)), 0.0, 1e-12);
  EXPECT_NEAR(mean_solar_hours(6 * 3600 * kSecondNs, 90_deg), 12.0, 1e-9);
  EXPECT_NEAR(mean_solar_hours(6 * 3600 * kSecondNs, degrees(-120.0)), 22.0, 1e-9);
  EXPECT_NEAR(mean_solar_hours(-6 * 3600 * kSecondNs, Radians(0.0)), 18.0, 1e-9);
}

TEST(ClearSky, IrradianceMatchesPublishedValuesAtThreeZenithAngles) {
  // The reference is Ineichen with TL 3.5, 400 m above the sea at midsummer (sun at 1.0163 au), by
  // an independent implementation that rounds to 1 W/m2: DNI/DHI at z = 25, 60, 75 deg.
  struct Row {
    double zenith_deg, direct, diffuse;
  };
  for (const Row& row : {Row{25, 868, 118}, Row{60, 717, 81}, Row{75, 485, 50}}) {
    SunPosition sun = sun_at_zenith_angle(row.zenith_deg);
    sun.distance_au = 1.0163;
    const auto got = clear_sky_irradiance(sun, 400_m, 3.5);
    EXPECT_NEAR(got.direct_normal_w_m2, row.direct, 2.0) << row.zenith_deg;
    EXPECT_NEAR(got.diffuse_horizontal_w_m2, row.diffuse, 1.0) << row.zenith_deg;
  }
}

TEST(ClearSky, HazeMovesSunlightFromDirectToDiffuseAndNightHasNone) {
  const SunPosition sun = sun_at_zenith_angle(45.0);
  double direct = 2000.0;
  double diffuse = 0.0;
  for (const double turbidity : {2.0, 3.0, 5.0, 7.0}) {
    const auto got = clear_sky_irradiance(sun, 400_m, turbidity);
    EXPECT_LT(got.direct_normal_w_m2, direct);
    EXPECT_GT(got.diffuse_horizontal_w_m2, diffuse);
    direct = got.direct_normal_w_m2;
    diffuse = got.diffuse_horizontal_w_m2;
  }
  const auto night = clear_sky_irradiance(sun_at_zenith_angle(90.5), 0_m, 3.5);
  EXPECT_EQ(night.direct_normal_w_m2, 0.0);
  EXPECT_EQ(night.diffuse_horizontal_w_m2, 0.0);
  const auto horizon = clear_sky_irradiance(sun_at_zenith_angle(89.9), 0_m, 3.5);
  EXPECT_GE(horizon.direct_normal_w_m2, 0.0);
  EXPECT_GE(horizon.diffuse_horizontal_w_m2, 0.0);
}

TEST(ClearSky, AirMassIsOneOverheadAnd38AtTheHorizon) {
  EXPECT_NEAR(relative_air_mass(90_deg), 1.0, 1e-3);
  EXPECT_NEAR(relative_air_mass(30_deg), 1.994, 1e-3);
  EXPECT_NEAR(relative_air_mass(0_deg), 37.92, 0.1);
  EXPECT_EQ(relative_air_mass(degrees(-10.0)), 0.0);
  EXPECT_NEAR(pressure_ratio(0_m), 1.0, 1e-15);
  EXPECT_NEAR(pressure_ratio(5500_m), 0.498, 2e-3);
}

TEST(ClearSky, LongwaveMatchesTheRecalibratedFormAndCloudsCloseTheWindow) {
  // Air of 293.15 K with a dew point of 285.15 K gives 347.4 W/m2.
  EXPECT_NEAR(sky_longwave_w_m2(Kelvin(293.15), Kelvin(285.15), 0.0), 347.4, 0.2);
  const double clear = sky_emissivity_frac(Kelvin(280.0), 0.0);
  EXPECT_NEAR(sky_emissivity_frac(Kelvin(280.0), 1.0), clear + 0.784 * (1.0 - clear), 1e-14);
  EXPECT_LE(sky_emissivity_frac(Kelvin(330.0), 1.0), 1.0);
  // Clouds at the ground are as warm as the air, and then the sky is a blackbody.
  const double black = kStefanBoltzmannWPerM2K4 * std::pow(293.15, 4.0);
  EXPECT_NEAR(sky_longwave_w_m2(Kelvin(293.15), Kelvin(275.0), 1.0, {.height_m = 0.0}), black,
              1e-9 * black);
  // Clouds of no stated base are those of eq. 12.
  EXPECT_NEAR(sky_longwave_w_m2(Kelvin(293.15), Kelvin(275.0), 0.7),
              sky_emissivity_frac(Kelvin(275.0), 0.7) * black, 1e-9 * black);
}

TEST(SkyState, sends_the_irradiance_that_it_was_made_from) {
  const double black = kStefanBoltzmannWPerM2K4 * std::pow(290.0, 4.0);
  for (const CloudBase& base :
       {CloudBase{}, CloudBase{.height_m = 300.0}, CloudBase{.kelvin = 265.0}}) {
    const auto irradiance = [&base](double cover) {
      return sky_longwave_w_m2(Kelvin(290.0), Kelvin(280.0), cover, base);
    };
    const double clear = irradiance(0.0);
    for (const double stated_frac : {0.0, 0.4, 1.0}) {
      for (double sent = 150.0; sent < 1.2 * black; sent += 7.0) {
        const SkyState sky = sky_state(sent, 290.0, 280.0, stated_frac, base);
        EXPECT_GE(sky.cloud_cover_frac, stated_frac);
        EXPECT_LE(sky.cloud_cover_frac, 1.0);
        const double clear_part = clear * std::pow(1.0 + sky.warmer_k / 290.0, 4.0);
        const double cloud_part = kStefanBoltzmannWPerM2K4 * std::pow(sky.cloud_k, 4.0);
        EXPECT_NEAR((1.0 - sky.cloud_cover_frac) * clear_part + sky.cloud_cover_frac * cloud_part,
                    sent, 1e-9 * sent);
        if (sent > clear && sent < black) {
          EXPECT_NEAR(sky.warmer_k, 0.0, 1e-9);
        }
        // A base of free height sends what the clouds do, behind the air of eq. 12.
        const double warmth = 1.0 + sky.warmer_k / 290.0;
        if (base.height_m) {
          EXPECT_NEAR(sky.cloud_base_k, cloud_base_k(base, 290.0) * warmth, 1e-9);
        } else if (sky.cloud_base_k > 1.001 * kColdestCloudK * warmth) {
          const double base_part =
              kStefanBoltzmannWPerM2K4 * std::pow(sky.cloud_base_k, 4.0) * (1.0 - clear / black);
          EXPECT_NEAR(clear * std::pow(warmth, 4.0) + base_part, cloud_part, 1e-9 * cloud_part);
        }
        EXPECT_LE(sky.cloud_base_k, 290.0 * warmth + 1e-9);
        EXPECT_GE(sky.cloud_base_k, kColdestCloudK * warmth - 1e-9);
      }
    }
    for (const double cover : {0.0, 0.3, 1.0}) {
      const SkyState sky = sky_state(irradiance(cover), 290.0, 280.0, 0.0, base);
      EXPECT_NEAR(sky.cloud_cover_frac, cover, 1e-12);
      EXPECT_NEAR(sky.warmer_k, 0.0, 1e-9);
      if (cover > 0.0) {
        EXPECT_NEAR(sky.cloud_base_m, cloud_base_m(base, 290.0), 1e-6);
      }
    }
    // An overcast sky has the temperature of its irradiance, whatever that is.
    for (const double sent : {irradiance(1.0), black, 1.05 * black}) {
      const SkyState sky = sky_state(sent, 290.0, 280.0, 0.0, base);
      EXPECT_NEAR(sky.cloud_cover_frac, 1.0, 1e-12);
      EXPECT_NEAR(sky.cloud_k, std::pow(sent / kStefanBoltzmannWPerM2K4, 0.25), 1e-9);
    }
  }
  EXPECT_NEAR(sky_state(1.05 * black, 290.0, 280.0, 0.0, {}).cloud_base_m, 100.0, 1e-9);
  EXPECT_GT(sky_state(0.0, 290.0, 280.0, 0.0, {}).warmer_k, -290.0);
  EXPECT_GT(sky_state(0.0, 290.0, 280.0, 1.0, {}).cloud_k, 0.0);
}

TEST(ClearSky, AirIsWarmestAtThreeInTheAfternoon) {
  EXPECT_NEAR(daily_air_temperature(15.0, 290_K, 6_K).value(), 296.0, 1e-12);
  EXPECT_NEAR(daily_air_temperature(3.0, 290_K, 6_K).value(), 284.0, 1e-12);
  EXPECT_NEAR(film_coefficient_w_m2_k(2.0), 13.3, 1e-12);
  EXPECT_EQ(film_coefficient_w_m2_k(-1.0), 5.7);
}

TEST(Weather, RowsAreLinearBetweenAndConstantOutside) {
  const std::array<WeatherSample, 3> rows = {
      WeatherSample{100, 0.0, 10.0, 300.0, 280.0, 1.0, 0.0, 285.0, 7.0},
      WeatherSample{200, 800.0, 110.0, 340.0, 290.0, 3.0, 0.5, std::nullopt, std::nullopt},
      WeatherSample{300, 400.0, 60.0, 320.0, 288.0, 2.0, 0.0, std::nullopt, std::nullopt}};
  const Forcing middle = forcing_from_rows(rows, 150);
  EXPECT_DOUBLE_EQ(middle.direct_normal_w_m2, 400.0);
  EXPECT_DOUBLE_EQ(middle.diffuse_horizontal_w_m2, 60.0);
  EXPECT_DOUBLE_EQ(middle.longwave_down_w_m2, 320.0);
  EXPECT_DOUBLE_EQ(middle.air_k, 285.0);
  EXPECT_DOUBLE_EQ(middle.cloud_frac, 0.25);
  // The row without its own values uses the models: air temperature and the wind.
  EXPECT_DOUBLE_EQ(middle.environment_k, 0.5 * (285.0 + 290.0));
  EXPECT_DOUBLE_EQ(middle.stated_film_w_m2_k, 3.5);
  EXPECT_DOUBLE_EQ(middle.stated_film_frac, 0.5);
  EXPECT_DOUBLE_EQ(forcing_from_rows(rows, -5).air_k, 280.0);
  EXPECT_DOUBLE_EQ(forcing_from_rows(rows, 200).air_k, 290.0);
  EXPECT_DOUBLE_EQ(forcing_from_rows(rows, 999).air_k, 288.0);
}

TEST(Weather, TwoRowsAtOneInstantAreAJump) {
  std::array<WeatherSample, 3> rows;
  rows[0].air_k = rows[1].air_k = 280.0;
  rows[1].sim_time_ns = rows[2].sim_time_ns = 10;
  rows[2].air_k = 300.0;
  EXPECT_DOUBLE_EQ(forcing_from_rows(rows, 9).air_k, 280.0);
  EXPECT_DOUBLE_EQ(forcing_from_rows(rows, 10).air_k, 300.0);
}

TEST(Weather, ClearSkyJoinsTheModels) {
  const GeoPlace place{48.56_deg, 11.26_deg, 400_m};
  const std::int64_t noon = 1782040440LL * kSecondNs;  // 2026-06-21 11:14 UTC
  const SunPosition sun = sun_position(noon, place);
  ClearSky model;
  model.cloud_frac = 0.3;
  const Forcing f = forcing_from_clear_sky(model, place, sun, noon);
  const auto solar = clear_sky_irradiance(sun, place.height, model.linke_turbidity);
  EXPECT_EQ(f.direct_normal_w_m2, solar.direct_normal_w_m2);
  EXPECT_GT(f.direct_normal_w_m2, 800.0);
  EXPECT_EQ(f.cloud_frac, 0.3);
  EXPECT_EQ(f.environment_k, f.air_k);
  EXPECT_NEAR(f.air_k, 290.0 + 6.0 * std::cos(2.0 * kPi * 3.0 / 24.0), 0.05);
  EXPECT_DOUBLE_EQ(f.longwave_down_w_m2, sky_longwave_w_m2(Kelvin(f.air_k), 282_K, 0.3));
}

}  // namespace
TEST(SkyByTilt, MatchesClosedForms) {
  // An even sky is the same for all faces.
  for (const double radiance : sky_by_tilt([](double) { return 7.0; })) {
    EXPECT_NEAR(radiance, 7.0, 1e-12);
  }
  // A sky in proportion to the sine of the elevation: 2/3 of the zenith before a level face, 4/(3
  // pi) before an upright one, and nothing at the horizon.
  const SkyByTilt sine = sky_by_tilt([](double sin_elevation) { return sin_elevation; });
  EXPECT_NEAR(sky_at_tilt(sine, 1.0), 2.0 / 3.0, 1e-5);
  EXPECT_NEAR(sky_at_tilt(sine, 0.0), 4.0 / (3.0 * kPi), 2e-3);
  EXPECT_NEAR(sky_at_tilt(sine, -1.0), 0.0, 1e-12);
  // The mean over azimuths of the cosine is the projection that the face and the ring share.
  EXPECT_NEAR(tilted_cosine(1.0, 0.4), 0.4, 1e-15);
  EXPECT_NEAR(tilted_cosine(-1.0, 0.4), 0.0, 1e-15);
  EXPECT_NEAR(tilted_cosine(0.0, 0.0), 1.0 / kPi, 1e-15);
}

}  // namespace emit::physics
