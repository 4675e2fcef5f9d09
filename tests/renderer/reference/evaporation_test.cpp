// SPDX-License-Identifier: Apache-2.0
// Judges the evaporation of the real-time model against the layer solver, which has formulas of its
// own and no tangent: the shipped moist materials in five climates.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/physics/air_film.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/step_nodes.hpp"
#include "emit/physics/weather.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/surface_water.hpp"
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

/// Steady temperature of level, insulated ground by the equation of Penman and Monteith with the
/// formulas of FAO-56 (Allen et al. 1998, eq. 3, 8, 11 and 13), its radiation being that of its own
/// temperature. Without water it evaporates nothing.
double penman_monteith_k(double sun_w_m2, double sky_w_m2, double air_k, double humidity_frac,
                         double film_w_m2_k, double pressure_pa, bool wet, double resistance_s_m) {
  constexpr double kHeatJ_kg_k = 1013.0;
  constexpr double kGasJ_kg_k = 287.0;
  constexpr double kVapourJ_kg = 2.45e6;
  const double air_c = air_k - 273.15;
  const double density_kg_m3 = pressure_pa / (kGasJ_kg_k * air_k);
  const double air_s_m = density_kg_m3 * kHeatJ_kg_k / film_w_m2_k;
  const auto saturation_pa = [](double c) { return 610.8 * std::exp(17.27 * c / (c + 237.3)); };
  const double gamma_pa_k = kHeatJ_kg_k * pressure_pa / (0.622 * kVapourJ_kg);
  double surface_k = air_k;
  for (int i = 0; i < 200; ++i) {
    const double net_w_m2 =
        sun_w_m2 + sky_w_m2 - 0.95 * physics::kStefanBoltzmannWPerM2K4 * std::pow(surface_k, 4.0);
    // The slope is that between air and surface.
    const double middle_c = 0.5 * (air_c + surface_k - 273.15);
    const double slope_pa_k =
        4098.0 * saturation_pa(middle_c) / ((middle_c + 237.3) * (middle_c + 237.3));
    const double deficit_pa = (1.0 - humidity_frac) * saturation_pa(air_c);
    const double latent_w_m2 =
        wet ? (slope_pa_k * net_w_m2 + density_kg_m3 * kHeatJ_kg_k * deficit_pa / air_s_m) /
                  (slope_pa_k + gamma_pa_k * (1.0 + resistance_s_m / air_s_m))
            : 0.0;
    // Half steps keep the radiation from ringing.
    surface_k += 0.5 * (air_k + (net_w_m2 - latent_w_m2) / film_w_m2_k - surface_k);
  }
  return surface_k;
}

TEST(ReferenceEvaporation, WetSoilAndLawnAreCoolerThanDrySoilByPenmanAndMonteith) {
  constexpr double kSunW_m2 = 450.0;
  constexpr double kSkyW_m2 = 350.0;
  constexpr double kFilmW_m2_k = 20.0;
  for (const double air_k : {283.15, 293.15, 303.15}) {
    for (const double humidity_frac : {0.3, 0.6}) {
      scene::ScenarioDesc scenario = climate_scenario("temperate_summer");
      scenario.thermal.history_start_ns = -48 * kHourNs;
      scenario.thermal.spin_up_ns = 0;
      for (const std::int64_t t : {-48 * kHourNs, std::int64_t{0}}) {
        scene::WeatherSample row;
        row.sim_time_ns = t;
        row.diffuse_horizontal_w_m2 = kSunW_m2;
        row.longwave_down_w_m2 = kSkyW_m2;
        row.air_k = air_k;
        row.relative_humidity_frac = humidity_frac;
        row.film_w_m2_k = kFilmW_m2_k;
        scenario.weather.push_back(row);
      }
      scene::Material soil;
      soil.name = "soil";
      soil.solar_absorptance_frac = 0.8;
      soil.emissivity_frac = 0.95;
      soil.layers = {{0.5, 0.02, 30.0, 1000.0}};
      soil.base_k = air_k;
      std::vector<std::int64_t> nodes_ns;
      for (std::int64_t t = -48 * kHourNs; t <= 0; t += 30 * kMinuteNs) nodes_ns.push_back(t);
      const auto climate = reference::SurfaceClimate::create(scenario, {});
      ASSERT_TRUE(climate.has_value()) << climate.error().text;
      const auto forcing = renderer::surface_forcing(scenario, nodes_ns);
      ASSERT_TRUE(forcing.has_value());
      const double pressure_pa =
          101'325.0 * std::pow(1.0 - 2.25577e-5 * scenario.place.height_m, 5.2559);
      const auto expected_k = [&](bool wet, double resistance_s_m) {
        return penman_monteith_k(0.8 * kSunW_m2, 0.95 * kSkyW_m2, air_k, humidity_frac, kFilmW_m2_k,
                                 pressure_pa, wet, resistance_s_m);
      };
      const Courses dry = courses_of(scenario, soil, *climate, nodes_ns, *forcing);
      for (const double resistance_s_m : {0.0, 70.0}) {
        scene::Material moist = soil;
        moist.wetness_frac = 1.0;
        moist.surface_resistance_s_m = moist.night_resistance_s_m = resistance_s_m;
        const Courses wet = courses_of(scenario, moist, *climate, nodes_ns, *forcing);
        const double cooler_k = expected_k(false, 0.0) - expected_k(true, resistance_s_m);
        SCOPED_TRACE(testing::Message() << air_k << " K, humidity " << humidity_frac << ", "
                                        << resistance_s_m << " s/m");
        EXPECT_GT(cooler_k, 4.0);
        EXPECT_NEAR(dry.model_k.back() - wet.model_k.back(), cooler_k, 0.05 * cooler_k);
        EXPECT_NEAR(dry.truth_k.back() - wet.truth_k.back(), cooler_k, 0.05 * cooler_k);
      }
    }
  }
}

/// Temperate summer as a table, with a shower of half an hour at the start of the day's frames.
scene::ScenarioDesc shower(double rain_mm_h) {
  scene::ScenarioDesc scenario = climate_scenario("temperate_summer");
  scenario.thermal.history_start_ns = -48 * kHourNs;
  scenario.thermal.spin_up_ns = 0;
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  for (std::int64_t t = -48 * kHourNs; t <= 24 * kHourNs; t += 15 * kMinuteNs) {
    const std::int64_t utc_ns = scenario.epoch_utc_ns + t;
    const physics::Forcing f = physics::forcing_from_clear_sky(
        scenario.clear_sky, place, physics::sun_position(utc_ns, place), utc_ns);
    const bool rains = t > 0 && t <= kHourNs / 2;
    scene::WeatherSample row;
    row.sim_time_ns = t;
    row.direct_normal_w_m2 = rains ? 0.0 : f.direct_normal_w_m2;
    row.diffuse_horizontal_w_m2 = f.diffuse_horizontal_w_m2;
    row.longwave_down_w_m2 = f.longwave_down_w_m2;
    row.air_k = f.air_k;
    row.wind_m_s = f.wind_m_s;
    row.relative_humidity_frac = f.vapour_pa / physics::saturation_over_water_pa(f.air_k);
    row.rain_mm_h = rains ? rain_mm_h : 0.0;
    scenario.weather.push_back(row);
  }
  return scenario;
}

/// Time after the shower at which the wetness of level ground falls below a share, h.
template <class At>
double dry_h(const At& wet_at, double share) {
  for (std::int64_t t = kHourNs / 2; t <= 24 * kHourNs; t += kMinuteNs) {
    if (wet_at(t) < share)
      return static_cast<double>(t - kHourNs / 2) / static_cast<double>(kHourNs);
  }
  return 24.0;
}

/// Water that level ground gave to the air, mm, from its temperatures and its wetness at the nodes:
/// the vapour that the film h passes at a Lewis number of 1 is 0.622 h/(c_p p) (e_s - e_a).
double evaporated_mm(const reference::WaterCourse& course,
                     std::span<const reference::ClimateNode> nodes,
                     const scene::Material& material) {
  const glm::dvec3 up(0.0, 0.0, 1.0);
  const auto rate_mm_s = [&](std::size_t i) {
    const reference::ClimateNode& node = nodes[i];
    const double film_w_m2_k =
        physics::film_w_m2_k(physics::air_film(node.flow), up, scene::film_skin(material),
                             course.face_k[i] - node.air_k);
    const double open_mm_s = 0.622 * film_w_m2_k / (1013.0 * node.flow.pressure_pa) *
                             (reference::saturation_pa(course.face_k[i]) - node.vapour_pa);
    if (open_mm_s < 0.0) return course.water_mm[i] > 0.0 ? open_mm_s : 0.0;
    return course.wet_frac[i] * open_mm_s;
  };
  double sum_mm = 0.0;
  for (std::size_t i = 1; i < course.time_ns.size(); ++i) {
    const double dt_s = static_cast<double>(course.time_ns[i] - course.time_ns[i - 1]) * 1e-9;
    sum_mm += 0.5 * dt_s * (rate_mm_s(i - 1) + rate_mm_s(i));
  }
  return sum_mm;
}

TEST(ReferenceRain, GroundDriesAsTheReferenceDoes) {
  const scene::ScenarioDesc wet = shower(8.0);
  const scene::ScenarioDesc dry = shower(0.0);
  std::vector<std::int64_t> nodes_ns;
  for (std::int64_t t = -48 * kHourNs; t < 0; t += 30 * kMinuteNs) nodes_ns.push_back(t);
  const std::size_t judged_from = nodes_ns.size();
  for (std::int64_t t = 0; t <= 24 * kHourNs; t += 5 * kMinuteNs) nodes_ns.push_back(t);
  reference::ClimateOptions options;
  options.end_ns = nodes_ns.back();
  const auto climate = reference::SurfaceClimate::create(wet, options);
  const auto dry_climate = reference::SurfaceClimate::create(dry, options);
  ASSERT_TRUE(climate.has_value()) << climate.error().text;
  ASSERT_TRUE(dry_climate.has_value());
  for (const char* name :
       {"asphalt", "concrete_pavement", "roof_tile_clay", "gravel", "lawn", "soil", "sand"}) {
    const auto material = std::ranges::find(wet.materials, name, &scene::Material::name);
    ASSERT_NE(material, wet.materials.end()) << name;
    const auto forcing = renderer::surface_forcing(wet, nodes_ns, std::span(&*material, 1));
    const auto dry_forcing = renderer::surface_forcing(dry, nodes_ns, std::span(&*material, 1));
    ASSERT_TRUE(forcing.has_value() && dry_forcing.has_value());
    const Courses course = courses_of(wet, *material, *climate, nodes_ns, *forcing);
    const Courses parched = courses_of(dry, *material, *dry_climate, nodes_ns, *dry_forcing);
    double squares = 0.0;
    double worst_k = 0.0;
    double cooler_k = 0.0;
    for (std::size_t i = judged_from; i < forcing->size(); ++i) {
      const double off_k = course.model_k[i] - course.truth_k[i];
      squares += off_k * off_k;
      worst_k = std::max(worst_k, std::abs(off_k));
      cooler_k = std::max(cooler_k, parched.truth_k[i] - course.truth_k[i]);
    }
    const double rms_k = std::sqrt(squares / static_cast<double>(forcing->size() - judged_from));
    // Compare the water itself.
    const auto mesh = reference::material_mesh(*material);
    ASSERT_TRUE(mesh.has_value());
    const auto water = reference::water_course(climate->nodes(), *material,
                                               material->initial_k.value_or(wet.thermal.initial_k),
                                               climate->surroundings_reflectance_frac(), *mesh);
    ASSERT_FALSE(water.empty());
    const auto model_wet = [&](std::int64_t t) {
      const auto after = std::ranges::upper_bound(nodes_ns, t);
      const auto i =
          std::min(static_cast<std::size_t>(after - nodes_ns.begin()) - 1, forcing->size() - 1);
      const double way =
          static_cast<double>(t - nodes_ns[i]) / static_cast<double>(nodes_ns[i + 1] - nodes_ns[i]);
      return std::lerp((*forcing)[i].begin.wet_frac[0], (*forcing)[i].end.wet_frac[0], way);
    };
    const auto true_wet = [&](std::int64_t t) { return water.at(t); };
    const double model_h = dry_h(model_wet, 0.1);
    const double truth_h = dry_h(true_wet, 0.1);
    // All rain has gone somewhere: it evaporated, drained, or is still there.
    EXPECT_NEAR(water.evaporated_mm + water.drained_mm + water.water_mm.back(), 4.0, 1e-6 * 4.0)
        << name;
    EXPECT_GE(water.drained_mm, 0.0) << name;
    EXPECT_LE(*std::ranges::max_element(water.water_mm), *material->water_store_mm) << name;
    // The temperatures of the ground and the film of the air give as much as evaporated.
    const double given_mm = evaporated_mm(water, climate->nodes(), *material);
    EXPECT_NEAR(water.evaporated_mm, given_mm, 0.01 + 0.02 * given_mm) << name;
    EXPECT_LT(rms_k, 0.4) << name;
    EXPECT_LT(worst_k, 1.5) << name;
    EXPECT_GT(cooler_k, 2.0) << name;
    EXPECT_NEAR(model_h, truth_h, 0.1 + 0.1 * truth_h) << name;
    std::printf(
        "%-18s rms %.3f K, max %.3f K; up to %.1f K cooler than dry; wetness below 0.1 "
        "after %.2f h, reference %.2f h; %.3f mm evaporated (%.3f by its course), %.3f mm "
        "drained\n",
        name, rms_k, worst_k, cooler_k, model_h, truth_h, water.evaporated_mm, given_mm,
        water.drained_mm);
  }
}

TEST(ReferenceRain, SoilDriesAsFao56Says) {
  // FAO-56 eq. 74 to 77 with the evaporation of soil that stays wet: day by day, in small steps,
  // dDe = Kr(De) E_wet.
  scene::ScenarioDesc scenario = climate_scenario("temperate_summer");
  scenario.thermal.history_start_ns = -48 * kHourNs;
  scenario.thermal.spin_up_ns = 0;
  const auto found = std::ranges::find(scenario.materials, "soil", &scene::Material::name);
  ASSERT_NE(found, scenario.materials.end());
  scene::Material soil = *found;
  soil.wetness_frac = 1.0;
  scene::Material wet = soil;
  wet.water_store_mm = 1e4;
  wet.readily_evaporable_mm = 9e3;
  reference::ClimateOptions options;
  options.end_ns = 8 * 24 * kHourNs;
  const auto climate = reference::SurfaceClimate::create(scenario, options);
  ASSERT_TRUE(climate.has_value());
  const auto course = [&](const scene::Material& material) {
    const auto mesh = reference::material_mesh(material);
    EXPECT_TRUE(mesh.has_value());
    return reference::water_course(climate->nodes(), material, scenario.thermal.initial_k,
                                   climate->surroundings_reflectance_frac(), *mesh);
  };
  const reference::WaterCourse dries = course(soil);
  const reference::WaterCourse stays = course(wet);
  const double total_mm = *soil.water_store_mm;
  const double ready_mm = *soil.readily_evaporable_mm;
  double gone_mm = 0.0;
  double worst_mm = 0.0;
  for (std::size_t i = 1; i < dries.time_ns.size(); ++i) {
    const double open_mm = stays.water_mm[i - 1] - stays.water_mm[i];
    const double kr = std::clamp((total_mm - gone_mm) / (total_mm - ready_mm), 0.0, 1.0);
    gone_mm = std::clamp(gone_mm + (open_mm > 0.0 ? kr : 1.0) * open_mm, 0.0, total_mm);
    worst_mm = std::max(worst_mm, std::abs(total_mm - dries.water_mm[i] - gone_mm));
    if (dries.time_ns[i] % (24 * kHourNs) == 0) {
      std::printf("day %2d: %.2f mm gone, FAO-56 %.2f mm, wet soil %.2f mm\n",
                  static_cast<int>(dries.time_ns[i] / (24 * kHourNs)) + 2,
                  total_mm - dries.water_mm[i], gone_mm, 1e4 - stays.water_mm[i]);
    }
  }
  EXPECT_GT(gone_mm, 15.0);
  EXPECT_LT(worst_mm, 0.8);
}

TEST(ReferenceRain, LongStepsLoseNoWater) {
  // Steps of an hour, as far back in a history, against those of a minute: what fell between two
  // steps counts, and what is left later is the same.
  const scene::ScenarioDesc wet = shower(8.0);
  const auto material = std::ranges::find(wet.materials, "soil", &scene::Material::name);
  std::vector<double> left;
  for (const std::int64_t step_ns : {kMinuteNs, 20 * kMinuteNs, kHourNs}) {
    std::vector<std::int64_t> nodes_ns;
    for (std::int64_t t = -48 * kHourNs; t <= 24 * kHourNs; t += step_ns) nodes_ns.push_back(t);
    const auto forcing = renderer::surface_forcing(wet, nodes_ns, std::span(&*material, 1));
    ASSERT_TRUE(forcing.has_value());
    double rain_mm = 0.0;
    for (const auto& interval : *forcing) rain_mm += interval.rain_mm;
    EXPECT_NEAR(rain_mm, 4.0, 4e-6);
    left.push_back(forcing->back().end.wet_frac[0]);
  }
  EXPECT_GT(left[0], 0.05);
  EXPECT_NEAR(left[1], left[0], 0.02);
  EXPECT_NEAR(left[2], left[0], 0.04);
}

}  // namespace
