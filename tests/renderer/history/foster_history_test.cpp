// SPDX-License-Identifier: Apache-2.0
#include "history/foster_history.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <random>
#include <string_view>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "history/foster_setup.hpp"
#include "support/times.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
using physics::kReferenceK;

scene::Material material(const std::string& name, std::vector<scene::Layer> layers) {
  scene::Material out;
  out.name = name;
  out.solar_absorptance_frac = 0.8;
  out.emissivity_frac = 0.92;
  out.layers = std::move(layers);
  out.base_k = 288.15;
  return out;
}

/// Returns a scenario of 21 June at 48.56 N under a clear sky. Its history starts at `start_s`
/// after 06:00 UTC.
scene::ScenarioDesc scenario(double start_s) {
  scene::ScenarioDesc s;
  s.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  s.epoch_utc_ns = 1403330400LL * kSecondNs;
  s.clear_sky.wind_m_s = 2.0;
  s.materials = {
      material("road", {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}, {1.55, 1.2, 1900, 1158}}),
      material("concrete", {{0.1, 1.7, 2300, 878}, {0.9, 1.7, 2300, 878}}),
      material("sheet", {{0.001, 45.0, 7850, 470}, {0.02, 0.16, 1.2, 1005}}),
      material("wood", {{0.03, 0.15, 550, 1700}})};
  s.default_material = "road";
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 172'800 * kSecondNs;
  s.thermal.history_start_ns = static_cast<std::int64_t>(start_s) * kSecondNs;
  s.thermal.steps = 13;
  return s;
}

FosterHistory history_of(const scene::ScenarioDesc& s, const Environment& environment) {
  auto materials = foster_materials(s.materials, s.thermal);
  EXPECT_TRUE(materials.has_value());
  const FosterMaterial surroundings = materials->front();
  return FosterHistory(s, *materials, surroundings, environment, kReferenceK);
}

/// Returns the temperature as the shader computes it at the start of a frame: table, then tail.
double looked_up_k(const FosterHistory& history, std::size_t m, glm::dvec3 n) {
  const FosterMaterial& material = history.materials()[m];
  const auto nodes = static_cast<int>(history.grid_nodes());
  const glm::dvec3 unit = n;
  n /= std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  double u = n.x;
  double v = n.y;
  if (n.z < 0.0) {
    u = (1.0 - std::abs(n.y)) * (n.x >= 0.0 ? 1.0 : -1.0);
    v = (1.0 - std::abs(n.x)) * (n.y >= 0.0 ? 1.0 : -1.0);
  }
  const double x = (u * 0.5 + 0.5) * (nodes - 1);
  const double y = (v * 0.5 + 0.5) * (nodes - 1);
  const int i = std::min(static_cast<int>(x), nodes - 2);
  const int j = std::min(static_cast<int>(y), nodes - 2);
  const auto at = [&](int column, int row) {
    return history
        .table()[(m * history.grid_nodes() + static_cast<std::size_t>(row)) * history.grid_nodes() +
                 static_cast<std::size_t>(column)];
  };
  physics::FosterState<double> state{};
  for (std::size_t k = 0; k < state.size(); ++k) {
    const auto value = [&](int column, int row) {
      return static_cast<double>(at(column, row)[k / 4][static_cast<glm::length_t>(k % 4)]);
    };
    state[k] = (1.0 - (y - j)) * ((1.0 - (x - i)) * value(i, j) + (x - i) * value(i + 1, j)) +
               (y - j) * ((1.0 - (x - i)) * value(i, j + 1) + (x - i) * value(i + 1, j + 1));
  }
  const auto surface = physics::foster_surface(material.network, material.emissivity_frac,
                                               material.base_k, kReferenceK);
  for (const IntervalForcing& interval : history.tail()) {
    const double offset_k = physics::foster_offset_k(state, surface);
    physics::foster_advance(state,
                            unshadowed_drive(interval.begin, material, unit, kReferenceK, offset_k),
                            unshadowed_drive(interval.end, material, unit, kReferenceK, offset_k),
                            physics::foster_ladder(interval.dt_s, material.network), surface, 0.01);
  }
  return physics::foster_offset_k(state, surface);
}

/// Returns the same temperature from the definition: two days in steps of 20 s.
double spun_up_k(const scene::ScenarioDesc& s, const Environment& environment,
                 const FosterMaterial& material, const FosterMaterial& surroundings,
                 const glm::dvec3& n) {
  const auto surface_of = [](const FosterMaterial& m) {
    return physics::foster_surface(m.network, m.emissivity_frac, m.base_k, kReferenceK);
  };
  const auto steady = [](const FosterMaterial& m) {
    physics::FosterState<double> x{};
    for (std::size_t i = 0; i < m.network.count; ++i) {
      x[i] = m.network.modes[i].resistance_m2k_w * (m.initial_k - m.base_k) /
             m.network.resistance_m2k_w();
    }
    return x;
  };
  physics::FosterState<double> x = steady(material);
  physics::FosterState<double> ground = steady(surroundings);
  const auto forcing_at = [&](std::int64_t t_ns) {
    const auto sun = environment.sun_at(t_ns);
    const auto weather = environment.forcing_at(t_ns, sun);
    SurfaceForcing f;
    const double direct = sun.elevation.value() > 0.0 ? weather.direct_normal_w_m2 : 0.0;
    f.sun_w_m2 = direct * sun.direction_enu;
    f.diffuse_w_m2 = weather.diffuse_horizontal_w_m2;
    f.longwave_w_m2 = weather.longwave_down_w_m2;
    f.reflected_w_m2 =
        (1.0 - surroundings.solar_absorptance_frac) *
        (direct * std::max(0.0, sun.direction_enu.z) + weather.diffuse_horizontal_w_m2);
    f.environment_w_m2 =
        physics::kStefanBoltzmannWPerM2K4 *
        std::pow(kReferenceK + physics::foster_offset_k(ground, surface_of(surroundings)), 4);
    f.film = physics::air_film(physics::air_flow(weather));
    f.air_k = weather.air_k;
    return f;
  };
  constexpr std::int64_t kStepNs = 20 * kSecondNs;
  const auto gains = physics::foster_gains(20.0, material.network);
  const auto ground_gains = physics::foster_gains(20.0, surroundings.network);
  SurfaceForcing from = forcing_at(s.thermal.history_start_ns - s.thermal.spin_up_ns);
  for (std::int64_t t_ns = s.thermal.history_start_ns - s.thermal.spin_up_ns;
       t_ns < s.thermal.history_start_ns; t_ns += kStepNs) {
    SurfaceForcing to = forcing_at(t_ns + kStepNs);
    const glm::dvec3 up(0.0, 0.0, 1.0);
    const auto advance = [&](physics::FosterState<double>& states, const FosterMaterial& m,
                             const glm::dvec3& normal, const auto& step_gains) {
      const auto surface = surface_of(m);
      const double offset_k = physics::foster_offset_k(states, surface);
      physics::foster_step(states, unshadowed_drive(from, m, normal, kReferenceK, offset_k),
                           unshadowed_drive(to, m, normal, kReferenceK, offset_k), step_gains,
                           surface);
    };
    advance(ground, surroundings, up, ground_gains);
    advance(x, material, n, gains);
    from = to;
  }
  return physics::foster_offset_k(x, surface_of(material));
}

TEST(FosterHistory, SpinUpOfAnyDirectionIsWithinFiftyMillikelvinOfItsDefinition) {
  std::mt19937 rng(3);
  std::normal_distribution<double> normal;
  double worst_k = 0.0;
  double sum = 0.0;
  int count = 0;
  for (const double start_s : {0.0, 21600.0, 46800.0}) {  // morning, noon, after sunset
    const scene::ScenarioDesc s = scenario(start_s);
    const Environment environment(s);
    const FosterHistory history = history_of(s, environment);
    for (std::size_t m = 0; m < history.materials().size(); ++m) {
      for (int i = 0; i < 8; ++i) {
        const glm::dvec3 n =
            glm::normalize(glm::dvec3(normal(rng), normal(rng), 0.6 * normal(rng) + 0.3));
        const double error_k =
            looked_up_k(history, m, n) -
            spun_up_k(s, environment, history.materials()[m], history.materials()[0], n);
        EXPECT_LT(std::abs(error_k), 0.05)
            << start_s << " " << s.materials[m].name << " " << n.x << " " << n.y << " " << n.z;
        worst_k = std::max(worst_k, std::abs(error_k));
        sum += error_k * error_k;
        ++count;
      }
    }
  }
  RecordProperty("worst_k", std::to_string(worst_k));
  RecordProperty("rms_k", std::to_string(std::sqrt(sum / count)));
}

TEST(FosterHistory, WithoutSpinUpTheStatesAreTheSteadyProfile) {
  scene::ScenarioDesc s = scenario(0.0);
  s.thermal.spin_up_ns = 0;
  s.thermal.initial_k = 301.0;
  const Environment environment(s);
  const FosterHistory history = history_of(s, environment);
  EXPECT_TRUE(history.tail().empty());
  for (std::size_t m = 0; m < 4; ++m) {
    EXPECT_NEAR(kReferenceK + looked_up_k(history, m, glm::normalize(glm::dvec3(1, 2, 3))), 301.0,
                1e-4);
  }
}

TEST(FosterHistory, SurroundingsFollowTheWeatherWhereItStatesTheirTemperature) {
  scene::ScenarioDesc s = scenario(0.0);
  scene::WeatherSample sample;
  sample.direct_normal_w_m2 = 500.0;
  sample.longwave_down_w_m2 = 330.0;
  sample.air_k = 293.0;
  sample.environment_k = 281.0;
  s.weather = {sample};
  Environment environment(s);
  FosterHistory history = history_of(s, environment);
  StepPlan plan(s.thermal);
  plan.update(3600 * kSecondNs, environment, {});
  EXPECT_FALSE(history.update(plan, environment));
  EXPECT_DOUBLE_EQ(history.surroundings_now_k(), 281.0);
  EXPECT_NEAR(history.intervals().back().end.environment_w_m2,
              physics::kStefanBoltzmannWPerM2K4 * std::pow(281.0, 4), 1e-9);
  // The ground reflects 1 - 0.8 of its sunlight.
  const double sine = plan.sun_now().direction_enu.z;
  EXPECT_NEAR(history.intervals().back().end.reflected_w_m2, 0.2 * 500.0 * sine, 1e-3);
}

TEST(FosterHistory, SurroundingsWarmThroughTheMorningWhateverTheNumberOfSteps) {
  std::vector<double> found_k;
  for (const std::uint32_t steps : {9U, 27U, 180U}) {
    scene::ScenarioDesc s = scenario(0.0);
    s.thermal.steps = steps;
    const Environment environment(s);
    FosterHistory history = history_of(s, environment);
    StepPlan plan(s.thermal);
    plan.update(12600 * kSecondNs, environment, {});
    history.update(plan, environment);
    found_k.push_back(history.surroundings_now_k());
    EXPECT_GT(history.intervals().back().end.environment_w_m2,
              history.intervals().front().begin.environment_w_m2 + 40.0);
  }
  EXPECT_NEAR(found_k[0], found_k[2], 0.1);
  EXPECT_NEAR(found_k[1], found_k[2], 0.02);
}

TEST(FosterHistory, WeatherBeforeTheStartRunsTheSpinUpAgain) {
  const scene::ScenarioDesc s = scenario(0.0);
  Environment environment(s);
  FosterHistory history = history_of(s, environment);
  StepPlan plan(s.thermal);
  plan.update(3600 * kSecondNs, environment, {});
  EXPECT_FALSE(history.update(plan, environment));
  const StateTexels before = history.table()[7];

  scene::WeatherSample sample;
  sample.sim_time_ns = 1800 * kSecondNs;
  sample.air_k = 290.0;
  sample.longwave_down_w_m2 = 320.0;
  ASSERT_TRUE(environment.append(sample));
  // The change is after the start, so the table stays.
  EXPECT_FALSE(history.update(plan, environment));

  environment.reset();
  sample.sim_time_ns = -100'000 * kSecondNs;
  ASSERT_TRUE(environment.append(sample));
  EXPECT_TRUE(history.update(plan, environment));
  EXPECT_NE(history.table()[7][0].x, before[0].x);
  EXPECT_FALSE(history.update(plan, environment));
  environment.reset();
  EXPECT_TRUE(history.update(plan, environment));
  EXPECT_EQ(history.table()[7], before);
}

TEST(FosterHistory, NodesThatAreFoundWhenAskedForAreThoseOfTheWholeTable) {
  const scene::ScenarioDesc s = scenario(0.0);
  Environment environment(s);
  const auto materials = foster_materials(s.materials, s.thermal);
  ASSERT_TRUE(materials.has_value());
  const FosterHistory all = history_of(s, environment);
  FosterHistory asked(s, *materials, materials->front(), environment, kReferenceK,
                      DryGrounds::followed, StartNodes::asked);
  const auto expect_same = [&](const FosterHistory& expected) {
    for (std::size_t m = 0; m < materials->size(); ++m) {
      for (const glm::dvec3& normal : {glm::dvec3(0.0, 0.0, 1.0), glm::dvec3(0.0, 0.0, -1.0),
                                       glm::dvec3(0.6, 0.0, 0.8), glm::dvec3(-0.48, 0.64, -0.6)}) {
        // The second answer is that of a node that is known.
        for (int i = 0; i < 2; ++i) {
          EXPECT_EQ(asked.start_states(m, normal), expected.start_states(m, normal)) << m;
        }
      }
    }
  };
  expect_same(all);
  // New weather before the start makes other nodes.
  scene::WeatherSample sample;
  sample.sim_time_ns = -100'000 * kSecondNs;
  sample.air_k = 290.0;
  sample.longwave_down_w_m2 = 320.0;
  ASSERT_TRUE(environment.append(sample));
  StepPlan plan(s.thermal);
  plan.update(3600 * kSecondNs, environment, {});
  EXPECT_TRUE(asked.update(plan, environment));
  const FosterHistory changed = history_of(s, environment);
  EXPECT_NE(changed.start_states(0, {0.0, 0.0, 1.0}), all.start_states(0, {0.0, 0.0, 1.0}));
  expect_same(changed);
}

TEST(FosterHistory, RainWetsWhatHoldsWaterAndNothingElse) {
  scene::ScenarioDesc s = scenario(0.0);
  s.materials[0].water_store_mm = 0.48;
  s.materials[1].water_store_mm = 0.48;
  s.materials[1].solar_absorptance_frac = 0.5;
  s.materials[3].water_store_mm = 2.0;
  Environment environment(s);
  FosterHistory history = history_of(s, environment);
  EXPECT_EQ(history.materials()[0].water_slot, 0);
  EXPECT_EQ(history.materials()[1].water_slot, 1);
  EXPECT_EQ(history.materials()[2].water_slot, -1);
  EXPECT_EQ(history.materials()[3].water_slot, 2);
  StepPlan plan(s.thermal);
  const std::int64_t now_ns = 12600 * kSecondNs;
  plan.update(now_ns, environment, {});
  history.update(plan, environment);
  const double dry_k = history.surroundings_now_k();
  for (const IntervalForcing& interval : history.intervals()) {
    for (const double wet_frac : interval.end.wet_frac) ASSERT_EQ(wet_frac, 0.0);
  }
  // The host lets it rain for ten minutes, which end five minutes before the frame.
  scene::WeatherSample live;
  const physics::Forcing before = environment.forcing_at(now_ns, environment.sun_at(now_ns));
  live.direct_normal_w_m2 = before.direct_normal_w_m2;
  live.diffuse_horizontal_w_m2 = before.diffuse_horizontal_w_m2;
  live.longwave_down_w_m2 = before.longwave_down_w_m2;
  live.air_k = before.air_k;
  live.wind_m_s = before.wind_m_s;
  live.sim_time_ns = now_ns - 900 * kSecondNs;
  live.rain_mm_h = 12.0;
  ASSERT_TRUE(environment.append(live));
  live.sim_time_ns = now_ns - 300 * kSecondNs;
  live.rain_mm_h = 0.0;
  ASSERT_TRUE(environment.append(live));
  plan.update(now_ns, environment, {});
  history.update(plan, environment);
  const auto& wet = history.intervals().back().end.wet_frac;
  EXPECT_GT(wet[0], 0.7);
  EXPECT_LT(wet[0], 1.0);
  // The paler ground is cooler and dries more slowly, and the larger store is not full.
  EXPECT_GT(wet[1], wet[0]);
  EXPECT_NEAR(wet[2], 1.0, 0.08);
  EXPECT_EQ(wet[3], 0.0);
  EXPECT_LT(history.surroundings_now_k(), dry_k - 3.0);
  // Wetness stays a share, and old intervals are dry.
  for (const IntervalForcing& interval : history.intervals()) {
    for (const double wet_frac : interval.begin.wet_frac) {
      ASSERT_GE(wet_frac, 0.0);
      ASSERT_LE(wet_frac, 1.0);
    }
  }
  EXPECT_EQ(history.intervals().front().begin.wet_frac[0], 0.0);
  // The state that goes from node to node has the water: going on from it dries the ground.
  const GroundState state = history.surroundings();
  EXPECT_GT(state.water[0].water_mm, 0.2);
  const IntervalForcing later = history.extend(now_ns, now_ns + 600 * kSecondNs, environment);
  EXPECT_LT(later.end.wet_frac[0], wet[0]);
  history.restore_surroundings(state);
  const IntervalForcing again = history.extend(now_ns, now_ns + 600 * kSecondNs, environment);
  EXPECT_EQ(again.end.wet_frac[0], later.end.wet_frac[0]);
  environment.reset();
  plan.update(now_ns, environment, {});
  history.update(plan, environment);
  EXPECT_EQ(history.surroundings_now_k(), dry_k);
}

TEST(FosterHistory, GroundBeforeTheFirstRainOfAHostIsItsOwn) {
  // Grounds that differ from the surroundings by colour, kind and thickness.
  scene::ScenarioDesc s = scenario(-12.0 * 3600.0);
  s.thermal.spin_up_ns = 0;
  s.materials[0].solar_absorptance_frac = 0.2;
  s.materials[1].water_store_mm = 0.48;
  s.materials[1].solar_absorptance_frac = 0.9;
  s.materials[2].water_store_mm = 0.48;
  s.materials[2].sheet = true;
  s.materials[3].water_store_mm = 2.0;
  s.materials.push_back(s.materials[1]);
  s.materials[4].water_store_mm = 19.0;
  s.materials[4].readily_evaporable_mm = 9.0;
  const std::int64_t start_ns = 4 * 3600 * kSecondNs;
  for (const std::int64_t wait_s : {60, 1800, 7200}) {
    const std::int64_t rain_ns = start_ns + wait_s * kSecondNs;
    const auto let_it_rain = [&](Environment& environment) {
      scene::WeatherSample live;
      const physics::Forcing now = environment.forcing_at(rain_ns, environment.sun_at(rain_ns));
      live.direct_normal_w_m2 = now.direct_normal_w_m2;
      live.diffuse_horizontal_w_m2 = now.diffuse_horizontal_w_m2;
      live.longwave_down_w_m2 = now.longwave_down_w_m2;
      live.air_k = now.air_k;
      live.wind_m_s = now.wind_m_s;
      live.sim_time_ns = rain_ns;
      live.rain_mm_h = 12.0;
      EXPECT_TRUE(environment.append(live));
      live.sim_time_ns = rain_ns + 600 * kSecondNs;
      live.rain_mm_h = 0.0;
      EXPECT_TRUE(environment.append(live));
    };
    // One history learns of the rain when it falls, the other one knows it from the start.
    Environment live(s);
    FosterHistory told = history_of(s, live);
    Environment all(s);
    let_it_rain(all);
    FosterHistory knew = history_of(s, all);
    StepPlan plan(s.thermal);
    plan.update(start_ns, live, {});
    told.update(plan, live);
    knew.update(plan, all);
    IntervalForcing is;
    IntervalForcing should;
    std::int64_t at_ns = start_ns;
    for (; at_ns < rain_ns + 4200 * kSecondNs; at_ns += 60 * kSecondNs) {
      if (at_ns == rain_ns) let_it_rain(live);
      is = told.extend(at_ns, at_ns + 60 * kSecondNs, live);
      should = knew.extend(at_ns, at_ns + 60 * kSecondNs, all);
    }
    // A later update computes the same course with other steps.
    plan.update(at_ns, live, {});
    told.update(plan, live);
    for (std::size_t slot = 0; slot < 4; ++slot) {
      EXPECT_EQ(is.end.wet_frac[slot], should.end.wet_frac[slot]) << slot << " " << wait_s;
      EXPECT_NEAR(told.intervals().back().end.wet_frac[slot], is.end.wet_frac[slot], 0.08)
          << slot << " " << wait_s;
    }
    EXPECT_GT(is.end.wet_frac[3], 0.02);
  }
}

TEST(FosterHistory, SoilStartsAsWetAsStatedAndDriesWithoutRain) {
  scene::ScenarioDesc s = scenario(0.0);
  s.materials[0].water_store_mm = 19.0;
  s.materials[0].readily_evaporable_mm = 9.0;
  s.materials[0].wetness_frac = 0.6;
  EXPECT_TRUE(scene::moisture_of(s.materials[0]).dry());
  const Environment environment(s);
  FosterHistory history = history_of(s, environment);
  StepPlan plan(s.thermal);
  plan.update(3600 * kSecondNs, environment, {});
  history.update(plan, environment);
  const double wet_frac = history.intervals().front().begin.wet_frac[0];
  // Some 4 of 6 mm evaporate in two days of June. The wetness that is left counts with eq. 65.
  EXPECT_LT(wet_frac, 0.15);
  EXPECT_GT(wet_frac, 0.02);
  const double left_mm = history.surroundings().water[0].water_mm;
  EXPECT_LT(left_mm, 4.5);
  EXPECT_GT(left_mm, 1.0);
}

TEST(FosterHistoryContract, ForcingHasOneEntryPerInterval) {
  scene::ScenarioDesc s = scenario(0.0);
  s.thermal.spin_up_ns = 0;
  const Environment environment(s);
  FosterHistory history = history_of(s, environment);
  const std::vector<std::int64_t> nodes_ns{0, kSecondNs, 2 * kSecondNs};
  std::vector<IntervalForcing> out(3);
  EXPECT_DEATH(history.forcing_over(nodes_ns, environment, out),
               "nodes_ns.size\\(\\) \\(4 == 3\\)");
}

TEST(FosterMaterials, NameTheMaterialWithoutLayers) {
  scene::ScenarioDesc s = scenario(0.0);
  s.materials[1].layers.clear();
  const auto materials = foster_materials(s.materials, s.thermal);
  ASSERT_FALSE(materials);
  EXPECT_NE(materials.error().text.find("'concrete'"), std::string::npos);
}

TEST(FosterMaterials, ShareGroundOnlyWhereAllThatDriesItIsTheSame) {
  using Change = std::pair<const char*, std::function<void(scene::Material&)>>;
  const Change changes[] = {
      {"store", [](scene::Material& m) { m.water_store_mm = 0.49; }},
      {"kind of store", [](scene::Material& m) { m.readily_evaporable_mm = 0.2; }},
      {"absorptance", [](scene::Material& m) { m.solar_absorptance_frac = 0.79; }},
      {"emissivity", [](scene::Material& m) { m.emissivity_frac = 0.91; }},
      {"roughness", [](scene::Material& m) { m.roughness = scene::Roughness::smooth; }},
      {"leaves", [](scene::Material& m) { m.surface_resistance_s_m = 70.0; }},
      {"base", [](scene::Material& m) { m.base_k = 287.15; }},
      {"kind of base", [](scene::Material& m) { m.base = scene::BaseKind::body; }},
      {"start", [](scene::Material& m) { m.initial_k = 280.0; }},
      // The resistance stays.
      {"heat capacity", [](scene::Material& m) { m.layers[0].density_kg_m3 *= 2.0; }},
      {"order of layers", [](scene::Material& m) { std::swap(m.layers[0], m.layers[1]); }},
      {"sheet", [](scene::Material& m) { m.sheet = !m.sheet; }}};
  for (const bool sheet : {false, true}) {
    scene::ScenarioDesc s = scenario(0.0);
    scene::Material& ground = s.materials[1];
    ground.layers = {{0.1, 1.7, 2300, 878}, {0.9, 0.7, 1200, 878}};
    ground.water_store_mm = 0.48;
    ground.sheet = sheet;
    for (const auto& [name, change] : changes) {
      // A sheet rests on nothing, and its capacity does not depend on the order of its layers.
      const std::string_view key = name;
      if (sheet && (key == "order of layers" || key == "kind of base")) continue;
      scene::Material other = ground;
      change(other);
      const auto built = foster_materials(std::vector{ground, other, ground}, s.thermal);
      ASSERT_TRUE(built.has_value());
      EXPECT_EQ((*built)[1].water_slot, 1) << name << (sheet ? " of a sheet" : "");
      EXPECT_EQ((*built)[2].water_slot, 0) << name << (sheet ? " of a sheet" : "");
    }
  }
}

/// Returns the scenario with its clear sky as an hourly table, in which it rains 2 mm in one hour
/// that begins at 06:00 UTC + `rain_h`.
scene::ScenarioDesc shower(std::int64_t rain_h) {
  scene::ScenarioDesc s = scenario(0.0);
  s.thermal.history_start_ns = -24 * 3600 * kSecondNs;
  s.thermal.spin_up_ns = 0;
  s.thermal.steps = 48;
  const physics::GeoPlace place{physics::Radians(s.place.lat_rad),
                                physics::Radians(s.place.lon_rad),
                                physics::Metres(s.place.height_m)};
  for (std::int64_t hour = -72; hour <= 24; ++hour) {
    const std::int64_t utc_ns = s.epoch_utc_ns + hour * 3600 * kSecondNs;
    const physics::Forcing f = physics::forcing_from_clear_sky(
        s.clear_sky, place, physics::sun_position(utc_ns, place), utc_ns);
    scene::WeatherSample row;
    row.sim_time_ns = hour * 3600 * kSecondNs;
    row.direct_normal_w_m2 = f.direct_normal_w_m2;
    row.diffuse_horizontal_w_m2 = f.diffuse_horizontal_w_m2;
    row.longwave_down_w_m2 = f.longwave_down_w_m2;
    row.air_k = f.air_k;
    row.wind_m_s = f.wind_m_s;
    row.rain_mm_h = hour == rain_h + 1 ? 2.0 : 0.0;
    s.weather.push_back(row);
  }
  return s;
}

TEST(FosterHistory, ThickAndThinSheetsDryByThemselves) {
  // Roofs of foam and of slate, with a shower before a clear morning.
  scene::ScenarioDesc s = shower(0);
  scene::Material foam = material("foam", {{0.02, 0.04, 20, 1400}});
  foam.sheet = true;
  foam.water_store_mm = 0.48;
  scene::Material slate = foam;
  slate.layers[0].density_kg_m3 = 2500.0;
  const Environment environment(s);
  const auto wet_of = [&](std::vector<scene::Material> materials) {
    // The first material is that of the surroundings, which hold no water.
    materials.insert(materials.begin(), scenario(0.0).materials[0]);
    s.materials = std::move(materials);
    FosterHistory history = history_of(s, environment);
    StepPlan plan(s.thermal);
    plan.update(2 * 3600 * kSecondNs, environment, {});
    history.update(plan, environment);
    std::vector<double> out;
    for (const FosterMaterial& m : history.materials().subspan(1)) {
      out.push_back(
          history.intervals().back().end.wet_frac[static_cast<std::size_t>(m.water_slot)]);
    }
    return out;
  };
  const double foam_frac = wet_of({foam})[0];
  const double slate_frac = wet_of({slate})[0];
  const std::vector<double> both_frac = wet_of({foam, slate});
  EXPECT_GT(std::abs(foam_frac - slate_frac), 0.05);
  EXPECT_EQ(both_frac[0], foam_frac);
  EXPECT_EQ(both_frac[1], slate_frac);
}

TEST(FosterHistory, SoilAfterOldRainIsThatOfEvenSteps) {
  // The history that scenarios have by themselves, whose oldest intervals last hours.
  constexpr std::int64_t kAnHourNs = 3600 * kSecondNs;
  double worst_k = 0.0;
  double longest_s = 0.0;
  for (const std::int64_t ago_h : {20, 36, 60}) {
    const std::int64_t now_ns = 6 * kAnHourNs;
    scene::ScenarioDesc s = shower(6 - ago_h);
    s.weather.insert(s.weather.begin(), s.weather.front());
    s.weather.front().sim_time_ns = -96 * kAnHourNs;
    s.thermal.history_start_ns = now_ns - 84 * kAnHourNs;
    s.materials[0].layers = {{0.4, 0.6, 1600, 1000}};
    s.materials[0].water_store_mm = 19.0;
    s.materials[0].readily_evaporable_mm = 9.0;
    for (scene::WeatherSample& row : s.weather) row.rain_mm_h *= 5.0;
    const Environment environment(s);
    const auto ground = [&](scene::StepSpacing spacing, std::uint32_t steps) {
      s.thermal.spacing = spacing;
      s.thermal.steps = steps;
      FosterHistory history = history_of(s, environment);
      StepPlan plan(s.thermal);
      plan.update(now_ns, environment, {});
      history.update(plan, environment);
      if (spacing == scene::StepSpacing::geometric) {
        longest_s = history.intervals().front().dt_s;
      }
      return std::pair(history.surroundings_now_k(), history.surroundings().water[0].water_mm);
    };
    const auto [is_k, is_mm] = ground(scene::StepSpacing::geometric, 64);
    const auto [even_k, even_mm] = ground(scene::StepSpacing::uniform, 1008);
    for (scene::WeatherSample& row : s.weather) row.rain_mm_h = 0.0;
    const Environment dry(s);
    FosterHistory history = history_of(s, dry);
    StepPlan plan(s.thermal);
    plan.update(now_ns, dry, {});
    history.update(plan, dry);
    std::printf(
        "soil %d h after rain: %.3f K and %.3f mm, even steps %.3f K and %.3f mm, dry %.2f K\n",
        static_cast<int>(ago_h), is_k, is_mm, even_k, even_mm, history.surroundings_now_k());
    EXPECT_GT(even_mm, 0.5);
    EXPECT_GT(history.surroundings_now_k() - even_k, 1.0);
    worst_k = std::max(worst_k, std::abs(is_k - even_k));
  }
  EXPECT_LT(worst_k, 0.13);
  EXPECT_NEAR(longest_s / 8.0, 4206.0, 1.0);
}

scene::Clutter clutter() {
  scene::Clutter out;
  out.solar_absorptance_sd_frac = 0.05;
  out.inertia_sd_ln = 0.5 * std::log(2.0);
  return out;
}

TEST(FosterMaterials, TwinsTakeTheSlotsThatTheMaterialsLeave) {
  for (const std::size_t count : {2U, 4U, 9U}) {
    scene::ScenarioDesc s = shower(0);
    const scene::Material road = s.materials[0];
    s.materials.clear();
    for (std::size_t m = 0; m < count; ++m) {
      s.materials.push_back(road);
      s.materials[m].name = "road " + std::to_string(m);
      s.materials[m].water_store_mm = 0.3 + 0.1 * static_cast<double>(m);
      s.materials[m].clutter = clutter();
    }
    s.default_material = "road 0";
    s.file = "s.toml";
    const auto built = build_foster_materials(s, s.materials);
    ASSERT_TRUE(built.has_value());
    ASSERT_EQ(built->size(), 3 * count + 1);
    std::size_t next = std::min<std::size_t>(count, physics::kWaterSlots);
    for (std::size_t m = 0; m < count; ++m) {
      const bool own = m < physics::kWaterSlots;
      EXPECT_EQ((*built)[m].water_shared, !own);
      EXPECT_EQ((*built)[m].water_slot, static_cast<int>(std::min(m, physics::kWaterSlots - 1)))
          << "nearest capacity";
      for (std::size_t twin = (*built)[m].first_twin; twin < (*built)[m].first_twin + 2; ++twin) {
        const bool left = next < physics::kWaterSlots;
        EXPECT_EQ((*built)[twin].water_shared, !left);
        EXPECT_EQ((*built)[twin].water_slot,
                  left ? static_cast<int>(next++) : (*built)[m].water_slot);
      }
    }
    // The surroundings are a material of the scene and take no slot of their own.
    EXPECT_EQ(built->back().water_slot, 0);
    EXPECT_FALSE(built->back().water_shared);
    const std::string warning = shared_water_warning(s, s.materials, *built);
    const auto names = [&](const std::string& text) {
      return warning.find(text) != std::string::npos;
    };
    EXPECT_EQ(warning.empty(), count == 2) << warning;
    EXPECT_EQ(names("s.toml: more materials hold rain water than the 8"), count > 2) << warning;
    EXPECT_EQ(names("'road 8' dries as another material does"), count == 9) << warning;
    EXPECT_FALSE(names("'road 7' dries as another")) << warning;
    EXPECT_FALSE(names("surroundings")) << warning;
    EXPECT_EQ(names("the clutter of 'road 1' dries as its mean does"), count == 9) << warning;
    EXPECT_EQ(names("the clutter of 'road 3' dries as its mean does"), count > 2) << warning;
    // Nobody is told about rain where none is known.
    for (scene::WeatherSample& row : s.weather) row.rain_mm_h = 0.0;
    EXPECT_EQ(shared_water_warning(s, s.materials, *built), "");
    // Every material has the ground of its slot in a history.
    const Environment environment(s);
    EXPECT_TRUE(make_foster(s, *built, environment, kReferenceK).has_value());
  }
}

TEST(FosterMaterials, TwinsWithTheGroundOfTheirMeanCostAccuracy) {
  // This is why twins have grounds of their own while there are slots.
  for (const std::int64_t rain_h : {-6, 0, 5}) {
    scene::ScenarioDesc s = shower(rain_h);
    s.materials[1].water_store_mm = 0.48;
    s.materials[1].clutter = clutter();
    const std::vector one{s.materials[1]};
    auto built = build_foster_materials(s, one);
    ASSERT_TRUE(built.has_value());
    const Environment environment(s);
    auto history = make_foster(s, *built, environment, kReferenceK);
    ASSERT_TRUE(history.has_value());
    StepPlan plan(s.thermal);
    std::int64_t at_ns = (rain_h - 1) * 3600 * kSecondNs;
    plan.update(at_ns, environment, {});
    history->update(plan, environment);
    double worst_k = 0.0;
    std::array<std::array<physics::FosterState<double>, 2>, 2> states{};
    for (std::size_t side = 0; side < 2; ++side) {
      states[side].fill(history->spun_up(1 + side, {0.0, 0.0, 1.0}));
    }
    for (int step = 0; step < 12 * 10; ++step) {
      const IntervalForcing forcing = history->extend(at_ns, at_ns + 300 * kSecondNs, environment);
      at_ns += 300 * kSecondNs;
      for (std::size_t side = 0; side < 2; ++side) {
        double k[2];
        for (std::size_t shares = 0; shares < 2; ++shares) {
          FosterMaterial twin = (*built)[1 + side];
          if (shares == 1) twin.water_slot = (*built)[0].water_slot;
          const auto surface =
              physics::foster_surface(twin.network, twin.emissivity_frac, twin.base_k, kReferenceK);
          physics::FosterState<double>& x = states[side][shares];
          const double offset_k = physics::foster_offset_k(x, surface);
          const auto drive = [&](const SurfaceForcing& f) {
            return unshadowed_drive(f, twin, {0.0, 0.0, 1.0}, kReferenceK, offset_k);
          };
          physics::foster_advance(x, drive(forcing.begin), drive(forcing.end),
                                  physics::foster_ladder(forcing.dt_s, twin.network), surface,
                                  0.01);
          k[shares] = physics::foster_offset_k(x, surface);
        }
        worst_k = std::max(worst_k, std::abs(k[1] - k[0]));
      }
    }
    std::printf("rain at %+d h: twins that share the ground of their mean are off by %.2f K\n",
                static_cast<int>(rain_h), worst_k);
    EXPECT_GT(worst_k, 0.1);
  }
}

TEST(FosterMaterials, TakeFittedModesUnlessAnotherNumberIsAskedFor) {
  scene::ScenarioDesc s = scenario(0.0);
  s.materials[0].foster_modes = {{23, 0.01}, {897, 0.02}, {7510, 0.05}};
  auto materials = foster_materials(s.materials, s.thermal);
  ASSERT_TRUE(materials);
  EXPECT_EQ((*materials)[0].network.count, 3U);
  EXPECT_EQ((*materials)[0].network.modes[1].tau_s, 897.0);
  s.thermal.foster_modes = 2;
  materials = foster_materials(s.materials, s.thermal);
  ASSERT_TRUE(materials);
  EXPECT_EQ((*materials)[0].network.count, 2U);
}

}  // namespace
}  // namespace emit::renderer
