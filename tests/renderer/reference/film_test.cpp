// SPDX-License-Identifier: Apache-2.0
// Judges the real-time model, whose film follows the temperature of the step before, against the
// layer solver, which has it at the temperature of now.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "history/foster_history.hpp"

namespace {

using namespace emit;

constexpr std::int64_t kMinuteNs = 60'000'000'000;

/// Returns a clear midsummer day with little wind, in which the film changes most. The body has one
/// layer, and its four modes come from the layer, so that both models have the same conduction to a
/// few hundredths of a kelvin.
scene::ScenarioDesc calm_day(double wind_m_s) {
  scene::ScenarioDesc s;
  s.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 400.0};
  s.epoch_utc_ns = 1'782'000'000'000'000'000;
  s.clear_sky.wind_m_s = wind_m_s;
  s.clear_sky.wind_from_rad = 1.0;
  scene::Material board;
  board.name = "board";
  board.solar_absorptance_frac = 0.8;
  board.emissivity_frac = 0.9;
  board.roughness = scene::Roughness::rough;
  board.layers = {{0.02, 0.2, 900.0, 1500.0}};
  board.base_k = 290.0;
  s.materials = {board};
  s.default_material = "board";
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.initial_k = 290.0;
  s.thermal.foster_modes = 4;
  return s;
}

TEST(Film, OfTheStepBeforeIsThatOfNow) {
  double worst_rms_k = 0.0;
  for (const double wind_m_s : {0.0, 1.0, 4.0}) {
    const scene::ScenarioDesc s = calm_day(wind_m_s);
    std::vector<std::int64_t> nodes_ns;
    constexpr std::int64_t kStepNs = 5 * kMinuteNs;
    for (std::int64_t t = 0; t <= 24 * 60 * kMinuteNs; t += kStepNs) nodes_ns.push_back(t);
    reference::ClimateOptions options;
    options.end_ns = nodes_ns.back();
    auto climate = reference::SurfaceClimate::create(s, options);
    ASSERT_TRUE(climate.has_value());
    const auto forcing = renderer::surface_forcing(s, nodes_ns);
    ASSERT_TRUE(forcing.has_value());
    const auto materials = renderer::foster_materials(s.materials, s.thermal);
    ASSERT_TRUE(materials.has_value());
    const renderer::FosterMaterial& material = materials->front();
    for (const glm::dvec3& normal :
         {glm::dvec3(0.0, 0.0, 1.0), glm::dvec3(0.0, -1.0, 0.0), glm::dvec3(0.0, 0.0, -1.0)}) {
      const auto truth =
          reference::point_history(*climate, s.materials[0], 290.0, normal, {}, nodes_ns);
      ASSERT_TRUE(truth.has_value());
      const auto surface = physics::foster_surface(material.network, material.emissivity_frac,
                                                   material.base_k, physics::kReferenceK);
      physics::FosterState<double> x{};
      const auto ladder = physics::foster_ladder(300.0, material.network);
      double squares = 0.0;
      double worst_k = 0.0;
      for (std::size_t i = 0; i < forcing->size(); ++i) {
        const double offset_k = physics::foster_offset_k(x, surface);
        const auto drive = [&](const renderer::SurfaceForcing& f) {
          return renderer::unshadowed_drive(f, material, normal, physics::kReferenceK, offset_k);
        };
        physics::foster_advance(x, drive((*forcing)[i].begin), drive((*forcing)[i].end), ladder,
                                surface, 0.01);
        const double off_k =
            physics::kReferenceK + physics::foster_offset_k(x, surface) - (*truth)[i + 1];
        squares += off_k * off_k / static_cast<double>(forcing->size());
        worst_k = std::max(worst_k, std::abs(off_k));
      }
      worst_rms_k = std::max(worst_rms_k, std::sqrt(squares));
      EXPECT_LT(std::sqrt(squares), 0.1) << wind_m_s << " m/s, up " << normal.z;
      EXPECT_LT(worst_k, 0.5) << wind_m_s << " m/s, up " << normal.z;
    }
  }
  RecordProperty("worst_rms_mk", static_cast<int>(1e3 * worst_rms_k));
}

TEST(Film, OfACalmNightIsNotThatOfTheWind) {
  // A cold roof under a clear sky cools far below calm air. Stable air hardly exchanges heat with
  // it.
  const std::vector<std::int64_t> times_ns{2 * 60 * kMinuteNs};
  double off_k[2] = {};
  for (const bool windy : {false, true}) {
    const scene::ScenarioDesc s = calm_day(windy ? 8.0 : 0.0);
    reference::ClimateOptions options;
    options.end_ns = times_ns[0];
    auto climate = reference::SurfaceClimate::create(s, options);
    ASSERT_TRUE(climate.has_value());
    scene::Material foam = s.materials[0];
    foam.layers = {{0.1, 0.03, 30.0, 1400.0}};
    const auto k = reference::point_history(*climate, foam, 290.0, {0.0, 0.0, 1.0}, {}, times_ns);
    ASSERT_TRUE(k.has_value());
    off_k[windy ? 1 : 0] = (*k)[0] - climate->at(times_ns[0]).air_k;
  }
  EXPECT_LT(off_k[0], -10.0);
  EXPECT_GT(off_k[1], -4.0);
}

// Judges the film of open water by the bulk coefficients that were measured at sea: 1.1e-3
// to 1.2e-3 in air of its temperature (Large and Pond 1982; Fairall et al. 2003).
TEST(Film, OfOpenWaterIsThatOfTheBulkFormula) {
  const double roughness = scene::roughness_factor(scene::Roughness::open_water);
  for (const double wind_m_s : {4.0, 6.0, 9.0, 13.0, 18.0}) {
    physics::AirFlow flow;
    flow.air_k = 288.0;
    flow.flow_m_s = {wind_m_s, 0.0, 0.0};
    const physics::AirProperties air = physics::air_properties(flow.air_k, flow.pressure_pa);
    const double film_w_m2_k =
        physics::film_w_m2_k(physics::air_film(flow), glm::dvec3(0.0, 0.0, 1.0), roughness, 0.1);
    const double coefficient = film_w_m2_k / (air.density_kg_m3 * 1005.0 * wind_m_s);
    EXPECT_GT(coefficient, 1.0e-3) << wind_m_s;
    EXPECT_LT(coefficient, 1.35e-3) << wind_m_s;
  }
}

// Judges the film of one side of a leaf by two published ones. They differ by a factor of 1.8.
TEST(Film, OfALeafLiesBetweenThePublishedOnes) {
  for (const double width_m : {0.005, 0.02, 0.06, 0.2}) {
    const physics::FilmSkin skin = physics::leaf_skin(width_m, 0.5);  // one side in all
    for (const double wind_m_s : {0.5, 2.0, 8.0}) {
      physics::AirFlow flow;
      flow.air_k = 293.15;
      flow.flow_m_s = {wind_m_s, 0.0, 0.0};
      const double ours =
          physics::film_w_m2_k(physics::air_film(flow), glm::dvec3(0.0, 0.0, 1.0), skin, 0.0);
      // Campbell and Norman (1998): 1.4 x 0.135 mol m-2 s-1 (u/d)^1/2, d = 0.7 width, and 29.3 J
      // mol-1 K-1. Leuning et al. (1995): 0.003 m/s (u/width)^1/2, without turbulence of the open.
      const double inside_m_s = 0.7 * wind_m_s;
      const double upper = 1.4 * 0.135 * 29.3 * std::sqrt(inside_m_s / (0.7 * width_m));
      const double lower = 1204.0 * 0.003 * std::sqrt(inside_m_s / width_m);
      EXPECT_NEAR(ours, upper, 0.04 * upper) << width_m << " m, " << wind_m_s << " m/s";
      EXPECT_GT(ours, lower) << width_m << " m, " << wind_m_s << " m/s";
      EXPECT_LT(upper, 1.9 * lower);
    }
    // Leuning et al. in still air: 0.5 D (1.6e8 width^3 dT)^1/4 / width, with D = 2.15e-5 m2/s.
    physics::AirFlow still;
    still.air_k = 293.15;
    for (const double excess_k : {1.0, 5.0, -5.0}) {
      const double ours =
          physics::film_w_m2_k(physics::air_film(still), glm::dvec3(0.0, 1.0, 0.0), skin, excess_k);
      const double theirs = 1204.0 * 0.5 * 2.15e-5 / width_m *
                            std::pow(1.6e8 * std::pow(width_m, 3.0) * std::abs(excess_k), 0.25);
      EXPECT_NEAR(ours, theirs, 0.25 * theirs) << width_m << " m, " << excess_k << " K";
    }
  }
}

// Leaves of well-watered trees in full sun were measured between the temperature of the air and 5 K
// above it (Leuzinger and Koerner 2007; Scherrer et al. 2011), and needles closer to the air than
// broad leaves. A closed surface in their place is far warmer.
TEST(Film, KeepsLeavesWithinKelvinsOfTheAir) {
  scene::ScenarioDesc s = calm_day(2.0);
  const std::vector<std::int64_t> times_ns{10 * 60 * kMinuteNs, 22 * 60 * kMinuteNs};
  reference::ClimateOptions options;
  options.end_ns = times_ns.back();
  const auto climate = reference::SurfaceClimate::create(s, options);
  ASSERT_TRUE(climate.has_value());
  scene::Material leaves = s.materials[0];
  leaves.solar_absorptance_frac = 0.8;
  leaves.emissivity_frac = 0.97;
  leaves.layers = {{0.004, 0.15, 120.0, 3500.0}, {0.1, 0.1, 6.0, 2500.0}};
  leaves.roughness = scene::Roughness::very_rough;
  leaves.wetness_frac = 1.0;
  leaves.surface_resistance_s_m = 100.0;
  leaves.night_resistance_s_m = 1000.0;
  const auto above_air_k = [&](std::optional<double> width_m) {
    scene::Material material = leaves;
    material.leaf_width_m = width_m;
    const auto k =
        reference::point_history(*climate, material, 290.0, {0.0, 0.0, 1.0}, {}, times_ns);
    EXPECT_TRUE(k.has_value());
    return std::pair((*k)[0] - climate->at(times_ns[0]).air_k,
                     (*k)[1] - climate->at(times_ns[1]).air_k);
  };
  const auto [closed_k, closed_night_k] = above_air_k(std::nullopt);
  const auto [broad_k, broad_night_k] = above_air_k(0.06);
  const auto [needle_k, needle_night_k] = above_air_k(0.01);
  std::printf(
      "above the air by day and night, K: closed %.2f %.2f, leaves %.2f %.2f, needles %.2f "
      "%.2f\n",
      closed_k, closed_night_k, broad_k, broad_night_k, needle_k, needle_night_k);
  EXPECT_GT(broad_k, 0.3);
  EXPECT_LT(broad_k, 5.0);
  EXPECT_LT(needle_k, 0.7 * broad_k);
  EXPECT_GT(closed_k, broad_k + 3.0);
  EXPECT_LT(broad_night_k, 0.0);
  EXPECT_GT(broad_night_k, -2.5);
  EXPECT_GT(needle_night_k, broad_night_k);
}

}  // namespace
