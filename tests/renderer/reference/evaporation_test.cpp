// SPDX-License-Identifier: Apache-2.0
// Judges the evaporation of the real-time model against the layer solver, which has formulas of its
// own and no tangent: the shipped moist materials in five climates.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/step_nodes.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/base.hpp"
#include "history/foster_history.hpp"

namespace {

using namespace emit;

constexpr std::int64_t kMinuteNs = 60'000'000'000;
constexpr std::int64_t kHourNs = 60 * kMinuteNs;

TEST(ReferenceEvaporation, SaturationIsThatOfTheSteamTables) {
  // IAPWS-95: 611.2 Pa at 0 C, 3169.9 Pa at 25 C, 12.352 kPa at 50 C, 101.42 kPa at 100 C.
  for (const auto& [celsius, pascal] : {std::pair{0.0, 611.2}, std::pair{25.0, 3169.9},
                                        std::pair{50.0, 12'352.0}, std::pair{100.0, 101'420.0}}) {
    EXPECT_NEAR(reference::saturation_pa(physics::kZeroCelsiusK + celsius), pascal, 3e-4 * pascal)
        << celsius;
  }
  // Over ice, Smithsonian tables.
  for (const auto& [celsius, pascal] : {std::pair{-10.0, 259.9}, std::pair{-30.0, 38.02}}) {
    EXPECT_NEAR(reference::saturation_pa(physics::kZeroCelsiusK + celsius), pascal, 2e-3 * pascal)
        << celsius;
  }
}

TEST(ReferenceEvaporation, FormulasOfBothSidesAgree) {
  // The real-time form for the same state, to the difference of the saturation formulas.
  for (const double face_c : {-15.0, 2.0, 18.0, 35.0, 50.0}) {
    for (const double resistance_s_m : {0.0, 70.0, 200.0}) {
      const double air_k = 293.15;
      const reference::FaceMoisture face{.vapour_pa = 900.0,
                                         .pressure_pa = 95'000.0,
                                         .wetness_frac = 0.7,
                                         .resistance_s_m = resistance_s_m};
      physics::FosterDrive<double> drive{.film_w_m2_k = 14.0};
      physics::add_moisture(
          {.wetness_frac = 0.7, .resistance_s_m = resistance_s_m, .night_resistance_s_m = 200.0},
          physics::moist_air(air_k, 95'000.0, 900.0), 500.0, drive);
      const double k = physics::kZeroCelsiusK + face_c;
      const double model_w_m2 = physics::latent_flux(k, drive).flux_w_m2;
      EXPECT_NEAR(model_w_m2, face.latent_w_m2(k, air_k, 14.0), 0.5 + 4e-3 * std::abs(model_w_m2))
          << face_c << " C, " << resistance_s_m << " s/m";
    }
  }
  for (const double shortwave_w_m2 : {0.0, 20.0, 70.0, 400.0}) {
    const physics::MoistSurface grass{
        .wetness_frac = 1.0, .resistance_s_m = 70.0, .night_resistance_s_m = 200.0};
    EXPECT_NEAR(physics::surface_resistance_s_m(grass, shortwave_w_m2),
                reference::light_resistance_s_m(grass, shortwave_w_m2), 1e-9);
  }
}

scene::ScenarioDesc climate_scenario(const std::string& name) {
  config::LoadOptions options;
  options.require_scene_files = false;
  options.environment.emplace();
  const auto path =
      std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "../config/climates" / (name + ".toml");
  auto loaded = config::load_scenario(path, {}, options);
  EXPECT_TRUE(loaded.has_value()) << (loaded ? "" : loaded.error().text);
  return loaded.value_or(scene::ScenarioDesc{});
}

/// Temperatures of a level, open surface by both models at the same instants.
struct Courses {
  std::vector<double> model_k;
  std::vector<double> truth_k;
};

Courses courses_of(const scene::ScenarioDesc& scenario, const scene::Material& desc,
                   const reference::SurfaceClimate& climate, std::span<const std::int64_t> nodes_ns,
                   std::span<const renderer::IntervalForcing> forcing) {
  Courses out;
  const glm::dvec3 up(0.0, 0.0, 1.0);
  const auto truth =
      reference::point_history(climate, desc, scenario.thermal.initial_k, up, {}, nodes_ns);
  EXPECT_TRUE(truth.has_value());
  if (!truth) return out;
  const auto materials = renderer::foster_materials(std::span(&desc, 1), scenario.thermal);
  EXPECT_TRUE(materials.has_value());
  const renderer::FosterMaterial& material = materials->front();
  const auto surface = physics::foster_surface(material.network, material.emissivity_frac,
                                               material.base_k, physics::kReferenceK);
  physics::FosterState<double> x = physics::foster_steady(
      (scenario.thermal.initial_k - material.base_k) / material.network.resistance_m2k_w(),
      surface);
  for (std::size_t i = 0; i < forcing.size(); ++i) {
    const double offset_k = physics::foster_offset_k(x, surface);
    const auto drive = [&](const renderer::SurfaceForcing& f) {
      return renderer::unshadowed_drive(f, material, up, physics::kReferenceK, offset_k);
    };
    physics::foster_advance(x, drive(forcing[i].begin), drive(forcing[i].end),
                            physics::foster_ladder(forcing[i].dt_s, material.network), surface,
                            scenario.thermal.tolerance_k);
    out.model_k.push_back(physics::kReferenceK + physics::foster_offset_k(x, surface));
    out.truth_k.push_back((*truth)[i + 1]);
  }
  return out;
}

class MoistInClimate : public testing::TestWithParam<const char*> {};

TEST_P(MoistInClimate, MaterialsFollowTheReferenceWithinTheBar) {
  const scene::ScenarioDesc scenario = [&] {
    scene::ScenarioDesc s = climate_scenario(GetParam());
    // Two days lead to the one that is judged.
    s.thermal.history_start_ns = -48 * kHourNs;
    s.thermal.spin_up_ns = 0;
    return s;
  }();
  // Steps as in a history: long ones first, then five minutes over the day that counts.
  std::vector<std::int64_t> nodes_ns;
  for (std::int64_t t = -48 * kHourNs; t < 0; t += 30 * kMinuteNs) nodes_ns.push_back(t);
  const std::size_t judged_from = nodes_ns.size();
  for (std::int64_t t = 0; t <= 24 * kHourNs; t += 5 * kMinuteNs) nodes_ns.push_back(t);
  reference::ClimateOptions options;
  options.end_ns = nodes_ns.back();
  const auto climate = reference::SurfaceClimate::create(scenario, options);
  ASSERT_TRUE(climate.has_value()) << climate.error().text;
  const auto forcing = renderer::surface_forcing(scenario, nodes_ns);
  ASSERT_TRUE(forcing.has_value());
  std::size_t moist = 0;
  for (const scene::Material& material : scenario.materials) {
    if (scene::moisture_of(material).dry()) continue;
    ++moist;
    const Courses wet = courses_of(scenario, material, *climate, nodes_ns, *forcing);
    scene::Material parched = material;
    parched.wetness_frac = 0.0;
    const Courses dry = courses_of(scenario, parched, *climate, nodes_ns, *forcing);
    ASSERT_EQ(wet.model_k.size(), forcing->size());
    double squares = 0.0;
    double worst_k = 0.0;
    double warmest_k = 0.0;
    double warmest_dry_k = 0.0;
    for (std::size_t i = judged_from; i < forcing->size(); ++i) {
      const double off_k = wet.model_k[i] - wet.truth_k[i];
      squares += off_k * off_k;
      worst_k = std::max(worst_k, std::abs(off_k));
      warmest_k = std::max(warmest_k, wet.model_k[i]);
      warmest_dry_k = std::max(warmest_dry_k, dry.model_k[i]);
    }
    const double rms_k = std::sqrt(squares / static_cast<double>(forcing->size() - judged_from));
    EXPECT_LT(rms_k, 0.4) << material.name;
    EXPECT_LT(worst_k, 1.5) << material.name;
    EXPECT_LT(warmest_k, warmest_dry_k + 0.01) << material.name;
    std::printf("%-18s %-14s rms %.3f K, max %.3f K; warmest %.2f K, as dry layers %.2f K\n",
                GetParam(), material.name.c_str(), rms_k, worst_k, warmest_k, warmest_dry_k);
  }
  EXPECT_GE(moist, 9U);
}
INSTANTIATE_TEST_SUITE_P(FiveClimates, MoistInClimate,
                         testing::Values("hot_desert", "temperate_summer", "temperate_winter",
                                         "humid_tropics", "polar_overcast"));

TEST(ReferenceEvaporation, LawnAtNoonIsNearTheAirAndNotNearItsDryLayers) {
  scene::ScenarioDesc scenario = climate_scenario("temperate_summer");
  scenario.thermal.history_start_ns = -48 * kHourNs;
  scenario.thermal.spin_up_ns = 0;
  std::vector<std::int64_t> nodes_ns;
  // Simulation begins at 10:00 local solar time: noon is two hours later.
  for (std::int64_t t = -48 * kHourNs; t <= 2 * kHourNs; t += 10 * kMinuteNs) nodes_ns.push_back(t);
  reference::ClimateOptions options;
  options.end_ns = nodes_ns.back();
  const auto climate = reference::SurfaceClimate::create(scenario, options);
  ASSERT_TRUE(climate.has_value());
  const auto forcing = renderer::surface_forcing(scenario, nodes_ns);
  ASSERT_TRUE(forcing.has_value());
  const double air_k = climate->at(nodes_ns.back()).air_k;
  for (const char* name : {"grass", "lawn"}) {
    const auto material = std::ranges::find(scenario.materials, name, &scene::Material::name);
    ASSERT_NE(material, scenario.materials.end());
    scene::Material parched = *material;
    parched.wetness_frac = 0.0;
    const double wet_k =
        courses_of(scenario, *material, *climate, nodes_ns, *forcing).model_k.back();
    const double dry_k = courses_of(scenario, parched, *climate, nodes_ns, *forcing).model_k.back();
    std::printf("%s at noon: %.2f K, as dry layers %.2f K, air %.2f K\n", name, wet_k, dry_k,
                air_k);
    // Grass that is short of no water is at most some ten kelvins above the air.
    EXPECT_LT(wet_k - air_k, 10.0) << name;
    EXPECT_GT(dry_k - wet_k, 5.0) << name;
  }
}

}  // namespace
