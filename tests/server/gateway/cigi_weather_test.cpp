// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <numbers>

#include "emit/physics/evaporation.hpp"
#include "gateway/cigi_weather.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;

constexpr std::int64_t kSecondNs = 1'000'000'000;

scene::ScenarioDesc scenario_at_noon() {
  scene::ScenarioDesc out;
  out.place = {0.84, 0.2, 300.0};
  out.epoch_utc_ns = 1'781'956'800 * kSecondNs;  // 2026-06-20, 12:00
  return out;
}

TEST(CigiWeather, WithoutAPacketTheScenariosWeatherHolds) {
  const scene::ScenarioDesc scenario = scenario_at_noon();
  CigiWeather weather(&scenario);
  EXPECT_FALSE(weather.take_change(0));
  EXPECT_FALSE(weather.take_change(3600 * kSecondNs));
}

TEST(CigiWeather, AirAndWindReplaceThoseOfTheClearSky) {
  const scene::ScenarioDesc scenario = scenario_at_noon();
  CigiWeather weather(&scenario);
  cigi::AtmosphereControl packet;
  packet.air_temperature_c = 7.0F;
  packet.horizontal_wind_m_s = 4.0F;
  ASSERT_TRUE(weather.take(packet));
  const auto change = weather.take_change(0);
  ASSERT_TRUE(change);
  EXPECT_NEAR(change->air_k, 280.15, 1e-4);
  EXPECT_EQ(change->wind_m_s, 4.0);
  EXPECT_GT(change->direct_normal_w_m2, 600.0);
  EXPECT_FALSE(weather.take_change(30 * kSecondNs));
  // The sun moves on, and with it the weather.
  const auto later = weather.take_change(8 * 3600 * kSecondNs);
  ASSERT_TRUE(later);
  EXPECT_LT(later->direct_normal_w_m2, 100.0);
  EXPECT_NEAR(later->air_k, 280.15, 1e-4);
  weather.clear();
  EXPECT_FALSE(weather.take_change(9 * 3600 * kSecondNs));
}

TEST(CigiWeather, HumidityAndDirectionOfTheWindReachTheSurfaces) {
  const scene::ScenarioDesc scenario = scenario_at_noon();
  CigiWeather weather(&scenario);
  cigi::AtmosphereControl packet;
  packet.air_temperature_c = 20.0F;
  packet.humidity_percent = 80;
  packet.wind_from_deg = -90.0F;
  ASSERT_TRUE(weather.take(packet));
  const auto moist = weather.take_change(0);
  ASSERT_TRUE(moist);
  EXPECT_NEAR(*moist->relative_humidity_frac, 0.8, 1e-12);
  EXPECT_NEAR(*moist->wind_from_deg, 270.0, 1e-12);
  // Drier air has a colder sky.
  packet.humidity_percent = 20;
  ASSERT_TRUE(weather.take(packet));
  const auto dry = weather.take_change(0);
  EXPECT_LT(dry->longwave_down_w_m2, moist->longwave_down_w_m2 - 20.0);
  // A host that knows no humidity sends 0 %: the scenario's holds.
  packet.humidity_percent = 0;
  ASSERT_TRUE(weather.take(packet));
  const auto unknown = weather.take_change(0);
  const double vapour_pa =
      *unknown->relative_humidity_frac * physics::saturation_over_water_pa(unknown->air_k);
  EXPECT_NEAR(vapour_pa, physics::saturation_over_water_pa(scenario.clear_sky.dew_point_k), 0.01);
}

TEST(CigiWeather, ARunHasNothingOfTheOneBefore) {
  const scene::ScenarioDesc scenario = scenario_at_noon();
  CigiWeather fresh(&scenario);
  CigiWeather used(&scenario);
  cigi::AtmosphereControl air;
  air.air_temperature_c = 35.0F;
  air.humidity_percent = 95;
  air.horizontal_wind_m_s = 9.0F;
  air.wind_from_deg = 45.0F;
  ASSERT_TRUE(used.take(air));
  cigi::WeatherControl storm;
  storm.layer_id = 2;
  storm.enabled = true;
  storm.coverage_percent = 100.0F;
  ASSERT_TRUE(used.take(storm));
  ASSERT_TRUE(used.take_change(0));
  used.clear();
  cigi::WeatherControl layer;
  layer.layer_id = 1;
  layer.enabled = true;
  layer.coverage_percent = 50.0F;
  ASSERT_TRUE(fresh.take(layer) && used.take(layer));
  const auto expected = fresh.take_change(0);
  const auto found = used.take_change(0);
  ASSERT_TRUE(expected && found);
  EXPECT_EQ(found->relative_humidity_frac, expected->relative_humidity_frac);
  EXPECT_EQ(found->wind_from_deg, expected->wind_from_deg);
  EXPECT_EQ(found->wind_m_s, expected->wind_m_s);
  EXPECT_EQ(found->air_k, expected->air_k);
  EXPECT_EQ(found->cloud_frac, expected->cloud_frac);
  EXPECT_EQ(found->longwave_down_w_m2, expected->longwave_down_w_m2);
}

TEST(CigiWeather, KeepsWhatTheTableStatesBesidesItsColumns) {
  scene::ScenarioDesc scenario = scenario_at_noon();
  for (const std::int64_t hour : {0, 1, 2}) {
    scene::WeatherSample row;
    row.sim_time_ns = hour * 3600 * kSecondNs;
    row.air_k = 290.0;
    row.longwave_down_w_m2 = 330.0;
    row.relative_humidity_frac = 0.9;
    row.wind_from_rad = 1.0;
    row.rain_mm_h = hour == 1 ? 2.5 : 0.0;
    scenario.weather.push_back(row);
  }
  CigiWeather weather(&scenario);
  cigi::WeatherControl layer;
  layer.layer_id = 1;
  layer.enabled = true;
  layer.coverage_percent = 50.0F;
  ASSERT_TRUE(weather.take(layer));
  const auto change = weather.take_change(1800 * kSecondNs);
  ASSERT_TRUE(change);
  EXPECT_NEAR(*change->relative_humidity_frac, 0.9, 1e-9);
  EXPECT_NEAR(*change->wind_from_deg, 180.0 / std::numbers::pi, 1e-9);
  EXPECT_EQ(change->rain_mm_h, 2.5);
}

TEST(CigiWeather, CloudsCoverAndWarmTheSky) {
  const scene::ScenarioDesc scenario = scenario_at_noon();
  CigiWeather clear(&scenario);
  CigiWeather covered(&scenario);
  cigi::AtmosphereControl air;
  air.air_temperature_c = 15.0F;
  ASSERT_TRUE(clear.take(air));
  ASSERT_TRUE(covered.take(air));
  cigi::WeatherControl layer;
  layer.layer_id = 1;
  layer.enabled = true;
  layer.coverage_percent = 50.0F;
  ASSERT_TRUE(covered.take(layer));
  layer.layer_id = 2;
  ASSERT_TRUE(covered.take(layer));
  const auto without = clear.take_change(0);
  const auto with = covered.take_change(0);
  EXPECT_NEAR(with->cloud_frac, 0.75, 1e-9) << "layers overlap at random";
  EXPECT_GT(with->longwave_down_w_m2, without->longwave_down_w_m2 + 10.0);
  layer.enabled = false;
  ASSERT_TRUE(covered.take(layer));
  EXPECT_NEAR(covered.take_change(0)->cloud_frac, 0.5, 1e-9);
  layer.scope = cigi::WeatherScope::entity;
  EXPECT_FALSE(covered.take(layer));
  layer.scope = cigi::WeatherScope::global;
  layer.layer_id = 4;
  EXPECT_FALSE(covered.take(layer)) << "rain";
}

TEST(CigiWeather, AComponentStatesAllOfIt) {
  CigiWeather weather(nullptr);
  cigi::ComponentControl packet;
  packet.component_class = cigi::ComponentClass::atmosphere;
  packet.component_id = CigiWeather::kRadiationComponent;
  const std::array<float, 6> values{800.0F, 90.0F, 310.0F, 295.0F, 3.0F, 0.25F};
  for (std::size_t i = 0; i < values.size(); ++i) {
    packet.data[i] = std::bit_cast<std::uint32_t>(values[i]);
  }
  ASSERT_TRUE(weather.take(packet));
  const auto change = weather.take_change(0);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->direct_normal_w_m2, 800.0);
  EXPECT_EQ(change->diffuse_horizontal_w_m2, 90.0);
  EXPECT_EQ(change->longwave_down_w_m2, 310.0);
  EXPECT_EQ(change->air_k, 295.0);
  EXPECT_EQ(change->wind_m_s, 3.0);
  EXPECT_EQ(change->cloud_frac, 0.25);
  EXPECT_FALSE(weather.take_change(7200 * kSecondNs)) << "the host says what changes";
  packet.data[3] = std::bit_cast<std::uint32_t>(std::numeric_limits<float>::quiet_NaN());
  EXPECT_FALSE(weather.take(packet));
  packet.component_id = 77;
  EXPECT_FALSE(weather.take(packet));
}

TEST(CigiWeather, ImpossibleAirIsRefused) {
  CigiWeather weather(nullptr);
  cigi::AtmosphereControl packet;
  packet.air_temperature_c = -300.0F;
  EXPECT_FALSE(weather.take(packet));
  EXPECT_FALSE(weather.take_change(0));
}

}  // namespace
}  // namespace emit::server
