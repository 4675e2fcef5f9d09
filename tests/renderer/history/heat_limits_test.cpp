// SPDX-License-Identifier: Apache-2.0
// Limits of the formulae for moisture, snow and air that a history passes, and rain on ground that
// gets a part of it.
#include "emit/renderer/heat_limits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/renderer/coarse_reasons.hpp"
#include "emit/scene/melting.hpp"
#include "history/foster_history.hpp"
#include "history/foster_setup.hpp"
#include "support/times.hpp"

namespace emit::renderer {
namespace {

constexpr std::int64_t kLimitHourNs = 3600 * emit::test::kSecondNs;

/// Overcast days of one material with a row of weather every hour, from two days before sim time 0.
scene::ScenarioDesc even_weather(double air_k) {
  scene::ScenarioDesc s;
  s.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  s.epoch_utc_ns = 1403330400LL * emit::test::kSecondNs;
  scene::Material ground;
  ground.name = "ground";
  ground.solar_absorptance_frac = 0.8;
  ground.emissivity_frac = 0.95;
  ground.layers = {{0.1, 1.0, 2000.0, 900.0}};
  ground.base_k = air_k;
  s.materials = {ground};
  s.default_material = "ground";
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.initial_k = air_k;
  s.thermal.history_start_ns = -24 * kLimitHourNs;
  s.thermal.spin_up_ns = 0;
  s.thermal.steps = 48;
  for (int hour = -48; hour <= 24; ++hour) {
    scene::WeatherSample row;
    row.sim_time_ns = hour * kLimitHourNs;
    row.diffuse_horizontal_w_m2 = 20.0;
    row.longwave_down_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(air_k, 4.0);
    row.air_k = air_k;
    row.wind_m_s = 4.0;
    row.relative_humidity_frac = 0.9;
    s.weather.push_back(row);
  }
  return s;
}

FosterHistory limit_history(const scene::ScenarioDesc& s, const Environment& environment,
                            DryGrounds dry_grounds) {
  auto built = build_foster_materials(s, s.materials);
  EXPECT_TRUE(built.has_value());
  const FosterMaterial surroundings = built->back();
  built->pop_back();
  return FosterHistory(s, *built, surroundings, environment, physics::kReferenceK, dry_grounds);
}

/// Names of the limits at an instant, by either way to follow dry grounds.
std::string limits_at(const scene::ScenarioDesc& s, std::int64_t now_ns = 0) {
  const Environment environment(s);
  StepPlan plan(s.thermal);
  plan.update(now_ns, environment, {});
  std::string both[2];
  for (const DryGrounds dry_grounds : {DryGrounds::followed, DryGrounds::skipped}) {
    FosterHistory history = limit_history(s, environment, dry_grounds);
    history.update(plan, environment);
    const HeatLimits limits = history.surroundings().limits.until(now_ns);
    std::string& names = both[static_cast<int>(dry_grounds)];
    for (std::size_t i = 0; i < kHeatLimits; ++i) {
      if (limits[i]) names += std::string(name_of(static_cast<HeatLimit>(i))) + " ";
    }
  }
  EXPECT_EQ(both[0], both[1]);
  return both[0];
}

TEST(HeatLimits, EachIsNamedWhereItIsPassedAndNowhereElse) {
  using Change = std::function<void(scene::ScenarioDesc&)>;
  const Change wet = [](scene::ScenarioDesc& s) { s.materials[0].wetness_frac = 1.0; };
  const Change store = [](scene::ScenarioDesc& s) { s.materials[0].water_store_mm = 0.5; };
  const Change rain = [](scene::ScenarioDesc& s) {
    for (scene::WeatherSample& row : s.weather) {
      if (row.sim_time_ns == -kLimitHourNs) row.rain_mm_h = 2.0;
    }
  };
  const Change snow = [](scene::ScenarioDesc& s) { s.materials[0].family = scene::kWaterFamily; };
  const Change unknown = [](scene::ScenarioDesc& s) {
    for (scene::WeatherSample& row : s.weather) row.relative_humidity_frac.reset();
  };
  const Change clear = [](scene::ScenarioDesc& s) { s.weather.clear(); };
  const auto wind = [](double wind_m_s) -> Change {
    return [wind_m_s](scene::ScenarioDesc& s) {
      for (scene::WeatherSample& row : s.weather) row.wind_m_s = wind_m_s;
    };
  };
  const auto sky = [](double black_frac) -> Change {
    return [black_frac](scene::ScenarioDesc& s) {
      for (scene::WeatherSample& row : s.weather) {
        row.longwave_down_w_m2 =
            black_frac * physics::kStefanBoltzmannWPerM2K4 * std::pow(row.air_k, 4.0);
      }
    };
  };
  const Change film = [](scene::ScenarioDesc& s) {
    for (scene::WeatherSample& row : s.weather) row.film_w_m2_k = 30.0;
  };
  const struct {
    double air_k;
    std::vector<Change> changes;
    const char* limits;
  } cases[] = {
      {285.0, {}, ""},
      {263.0, {}, ""},
      {285.0, {wet}, ""},
      {263.0, {wet}, "freezing "},
      {263.0, {store}, ""},
      {263.0, {store, rain}, "snowfall freezing "},
      {273.9, {store, rain}, "snowfall "},
      {275.0, {store, rain}, ""},
      {273.9, {rain}, "snowfall "},
      {263.0, {snow}, ""},
      {278.0, {snow}, "melting "},
      {278.0, {snow, wet}, ""},  // that is water
      {285.0, {unknown}, ""},
      {285.0, {unknown, wet}, "humidity_unknown "},
      {285.0, {unknown, store}, ""},
      {285.0, {unknown, store, rain}, "humidity_unknown "},
      {285.0, {clear, wet}, ""},
      {285.0, {wind(19.0)}, ""},
      {285.0, {wind(21.0)}, "strong_wind "},
      {285.0, {wind(21.0), film}, ""},
      {285.0, {sky(0.45)}, ""},
      {285.0, {sky(0.35)}, "longwave_low "},
      {285.0, {sky(0.0)}, "longwave_low "},
  };
  for (std::size_t i = 0; i < std::size(cases); ++i) {
    scene::ScenarioDesc s = even_weather(cases[i].air_k);
    for (const Change& change : cases[i].changes) change(s);
    EXPECT_EQ(limits_at(s), cases[i].limits) << "case " << i;
  }
}

TEST(HeatLimits, AreForgottenAfterSixHours) {
  scene::ScenarioDesc s = even_weather(285.0);
  for (scene::WeatherSample& row : s.weather) {
    if (row.sim_time_ns == 0) row.wind_m_s = 30.0;
  }
  EXPECT_EQ(limits_at(s, -3 * kLimitHourNs), "");
  EXPECT_EQ(limits_at(s, 5 * kLimitHourNs), "strong_wind ");
  EXPECT_EQ(limits_at(s, 12 * kLimitHourNs), "");
}

TEST(CoarseReasons, EachHasANameAndASentenceThatFitsTheLog) {
  for (std::size_t i = 0; i < kCoarseReasons; ++i) {
    const auto reason = static_cast<CoarseReason>(i);
    EXPECT_FALSE(name_of(reason).empty());
    EXPECT_GT(text_of(reason).size(), 20U);
    EXPECT_LE(text_of(reason).size(), 85U) << text_of(reason);
  }
}

TEST(HeatLimits, EachHasANameAndASentenceThatFitsTheLog) {
  for (std::size_t i = 0; i < kHeatLimits; ++i) {
    const auto limit = static_cast<HeatLimit>(i);
    EXPECT_FALSE(name_of(limit).empty());
    EXPECT_GT(text_of(limit).size(), 30U) << name_of(limit);
    EXPECT_LE(text_of(limit).size(), 85U) << name_of(limit);
    HeatLimits one;
    add(one, limit);
    EXPECT_TRUE(has(one, limit));
    EXPECT_EQ(one.count(), 1U);
  }
}

TEST(RainShare, GroundThatGetsHalfOfTheRainIsThatOfHalfAsMuchRain) {
  for (const bool soil : {false, true}) {
    const auto shower = [&](double rain_mm_h) {
      scene::ScenarioDesc s = even_weather(290.0);
      s.materials[0].water_store_mm = soil ? 19.0 : 1.9;
      if (soil) {
        s.materials[0].readily_evaporable_mm = 9.0;
        s.materials[0].wetness_frac = 0.5;
      }
      for (scene::WeatherSample& row : s.weather) {
        row.relative_humidity_frac = 0.4;
        row.environment_k = 290.0;
        if (row.sim_time_ns == -3 * kLimitHourNs) row.rain_mm_h = rain_mm_h;
      }
      const Environment environment(s);
      StepPlan plan(s.thermal);
      plan.update(0, environment, {});
      FosterHistory history = limit_history(s, environment, DryGrounds::followed);
      history.update(plan, environment);
      return std::vector(history.intervals().begin(), history.intervals().end());
    };
    const auto all = shower(1.2);
    const auto half = shower(0.6);
    const auto none = shower(0.0);
    double most = 0.0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      // Heat that dry ground has kept from the rain differs by nothing that shows.
      EXPECT_NEAR(all[i].end.half_wet_frac[0], half[i].end.wet_frac[0], 1e-9) << i;
      EXPECT_NEAR(all[i].end.sheltered_wet_frac[0], none[i].end.wet_frac[0], 1e-9) << i;
      most = std::max(most, all[i].end.wet_frac[0] - all[i].end.half_wet_frac[0]);
      // A face gets what lies between, by its share.
      const SurfaceForcing& f = all[i].end;
      EXPECT_EQ(f.wet_frac_at(0, 1.0), f.wet_frac[0]);
      EXPECT_EQ(f.wet_frac_at(0, rain_by_tilt_frac(0.5)), f.half_wet_frac[0]);
      EXPECT_EQ(f.wet_frac_at(0, rain_by_tilt_frac(-1.0)), f.sheltered_wet_frac[0]);
      EXPECT_NEAR(f.wet_frac_at(0, 0.75), 0.5 * (f.wet_frac[0] + f.half_wet_frac[0]), 1e-12);
    }
    EXPECT_GT(most, soil ? 0.02 : 0.1);
  }
}

TEST(DryGrounds, AreSkippedWhereNothingWetsThem) {
  scene::ScenarioDesc s = even_weather(290.0);
  s.materials[0].water_store_mm = 0.5;
  const Environment environment(s);
  StepPlan plan(s.thermal);
  plan.update(0, environment, {});
  FosterHistory followed = limit_history(s, environment, DryGrounds::followed);
  FosterHistory skipped = limit_history(s, environment, DryGrounds::skipped);
  const GroundState before = skipped.surroundings();
  followed.update(plan, environment);
  skipped.update(plan, environment);
  EXPECT_EQ(skipped.surroundings().water[0], before.water[0]);
  EXPECT_NE(followed.surroundings().water[0], before.water[0]);
  EXPECT_EQ(skipped.surroundings_now_k(), followed.surroundings_now_k());
  // Rain of a host gets both of them wet alike.
  Environment rainy(s);
  scene::WeatherSample live = s.weather[40];
  live.sim_time_ns = -2 * kLimitHourNs;
  live.rain_mm_h = 3.0;
  ASSERT_TRUE(rainy.append(live));
  plan.update(0, rainy, {});
  followed.update(plan, rainy);
  skipped.update(plan, rainy);
  EXPECT_GT(skipped.intervals().back().end.wet_frac[0], 0.5);
  EXPECT_EQ(skipped.intervals().back().end.wet_frac[0],
            followed.intervals().back().end.wet_frac[0]);
}

}  // namespace
}  // namespace emit::renderer
