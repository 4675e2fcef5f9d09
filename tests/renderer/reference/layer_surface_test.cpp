// SPDX-License-Identifier: Apache-2.0
// Surface points under a scenario's weather: balance, spin-up, shadows and surroundings.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/surface_forcing.hpp"

namespace emit {
namespace {

using reference::ClimateNode;
using reference::ClimateOptions;
using reference::FaceState;
using reference::PointSolver;
using reference::SurfaceClimate;
using reference::SurfaceOptics;
using reference::ViewSample;

constexpr std::int64_t kHourNs = 3'600'000'000'000;
const glm::dvec3 kUp(0.0, 0.0, 1.0);
const glm::dvec3 kEast(1.0, 0.0, 0.0);

double sigma_t4(double t_k) {
  return physics::kStefanBoltzmannWPerM2K4 * t_k * t_k * t_k * t_k;
}

/// Returns a clear midsummer day in Bavaria. Simulated time 0 is 0h UTC, and the history starts at
/// 04:00.
scene::ScenarioDesc summer_day() {
  scene::ScenarioDesc scenario;
  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 400.0};
  scenario.epoch_utc_ns = 1'782'000'000'000'000'000;  // the date is 2026-06-21 00:00
  scene::Material asphalt;
  asphalt.name = "asphalt";
  asphalt.solar_absorptance_frac = 0.9;
  asphalt.emissivity_frac = 0.93;
  asphalt.layers = {{0.15, 0.7, 2120.0, 920.0}, {0.3, 1.5, 2000.0, 950.0}};
  asphalt.base_k = 288.0;
  scenario.materials = {asphalt};
  scenario.default_material = "asphalt";
  scenario.thermal.initial_k = 292.0;
  scenario.thermal.history_start_ns = 4 * kHourNs;
  scenario.thermal.spin_up_ns = 24 * kHourNs;
  return scenario;
}

SurfaceClimate climate_of(const scene::ScenarioDesc& scenario, double step_s = 60.0) {
  ClimateOptions options;
  options.end_ns = 14 * kHourNs;
  options.step_s = step_s;
  auto climate = SurfaceClimate::create(scenario, options);
  EXPECT_TRUE(climate.has_value()) << climate.error().text;
  return std::move(*climate);
}

std::vector<double> history(const scene::ScenarioDesc& scenario, const SurfaceClimate& climate,
                            const glm::dvec3& normal, const std::vector<ViewSample>& view,
                            const std::vector<std::int64_t>& times) {
  auto result = point_history(climate, scenario.materials[0], scenario.thermal.initial_k, normal,
                              view, times);
  EXPECT_TRUE(result.has_value());
  return result.value_or(std::vector<double>(times.size(), 0.0));
}

TEST(FaceState, AddsEveryTermOfTheBalance) {
  ClimateNode climate;
  climate.to_sun = {0.6, 0.0, 0.8};
  climate.direct_normal_w_m2 = 800.0;
  climate.diffuse_horizontal_w_m2 = 100.0;
  climate.longwave_down_w_m2 = 350.0;
  climate.air_k = 295.0;
  climate.flow.stated_w_m2_k = 13.3;
  climate.flow.stated_frac = 1.0;
  climate.surroundings_k = 310.0;
  const SurfaceOptics wall{kEast, 0.7, 0.9};
  ViewSample view{0, 0.25, 0.4, 0.1, 12.0, 45.0};
  const FaceState state = face_state(climate, wall, view, 0.2);
  const double shortwave = 800.0 * 0.25 * 0.6 + 0.4 * 100.0 + 12.0 + 0.5 * 0.2 * 740.0;
  const double longwave = 0.4 * 350.0 + 45.0 + 0.5 * sigma_t4(310.0);
  EXPECT_NEAR(state.absorbed_w_m2, 0.7 * shortwave + 0.9 * longwave, 1e-9);
  EXPECT_EQ(state.film_at_w_m2_k(320.0), 13.3);
  EXPECT_EQ(state.air_k, 295.0);
  // The far side of the wall gets no direct sun.
  const FaceState back = face_state(climate, {-kEast, 0.7, 0.9}, view, 0.2);
  EXPECT_NEAR(state.absorbed_w_m2 - back.absorbed_w_m2, 0.7 * 800.0 * 0.25 * 0.6, 1e-9);
}

TEST(PointSolver, KeepsAnIsothermalWorldAtItsTemperature) {
  scene::ScenarioDesc scenario = summer_day();
  scene::WeatherSample calm;
  calm.air_k = 288.0;
  calm.wind_m_s = 3.0;
  calm.longwave_down_w_m2 = sigma_t4(288.0);
  scenario.weather = {calm};
  scenario.thermal.initial_k = 288.0;
  const SurfaceClimate climate = climate_of(scenario);
  const std::vector<std::int64_t> times{4 * kHourNs, 9 * kHourNs, 14 * kHourNs};
  // A wall sees some sky and some ground, and every share radiates alike.
  for (const double t : history(scenario, climate, kEast, {{0, 1.0, 0.3}}, times)) {
    EXPECT_NEAR(t, 288.0, 1e-8);
  }
}

TEST(PointSolver, UnshadowedLevelPointOfTheSurroundingsIsTheSurroundings) {
  const scene::ScenarioDesc scenario = summer_day();
  const SurfaceClimate climate = climate_of(scenario);
  const std::vector<std::int64_t> times{6 * kHourNs, 10 * kHourNs, 14 * kHourNs};
  const auto t = history(scenario, climate, kUp, {}, times);
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_NEAR(t[i], climate.at(times[i]).surroundings_k, 1e-6);
    EXPECT_GT(t[i], 285.0);
    EXPECT_LT(t[i], 345.0);
  }
  EXPECT_GT(t[1], t[0] + 5.0);  // the sun warms the point
}

TEST(PointSolver, ShadowActsFromItsEdgeOnAndNotBefore) {
  const scene::ScenarioDesc scenario = summer_day();
  const SurfaceClimate climate = climate_of(scenario);
  const std::int64_t edge = 9 * kHourNs + 17'000'000'000;
  const std::vector<std::int64_t> times{8 * kHourNs, edge, edge + 60'000'000'000, 11 * kHourNs};
  const auto sun = history(scenario, climate, kUp, {{0, 1.0, 0.9}}, times);
  const auto shade =
      history(scenario, climate, kUp, {{0, 1.0, 0.9}, {edge, 1.0, 0.9}, {edge, 0.0, 0.9}}, times);
  EXPECT_NEAR(shade[0], sun[0], 1e-4);
  EXPECT_NEAR(shade[1], sun[1], 1e-4);
  // One minute after the jump the solution is a half space under a film that stands for convection
  // and radiation.
  const ClimateNode then = climate.at(edge);
  const double jump = 0.9 * then.direct_normal_w_m2 * then.to_sun.z;
  const physics::FilmSkin skin = scene::film_skin(scenario.materials[0]);
  // The half space sees the slope of the convective flux, whose film falls as the face cools.
  const physics::AirFilm air = physics::air_film(then.flow);
  const auto lost_w_m2 = [&](double k) {
    return physics::film_w_m2_k(air, kUp, skin, k - then.air_k) * (k - then.air_k);
  };
  const double convection_w_m2_k = (lost_w_m2(sun[1]) - lost_w_m2(shade[2])) / (sun[1] - shade[2]);
  const double film = convection_w_m2_k + 4.0 * 0.93 * sigma_t4(sun[1]) / sun[1];
  const double x = film * std::sqrt(60.0 / (0.7 * 2120.0 * 920.0));
  const double drop = jump / film * (1.0 - std::exp(x * x) * std::erfc(x));
  EXPECT_NEAR((sun[2] - shade[2]) / drop, 1.0, 0.01);
  EXPECT_GT(sun[3] - shade[3], 8.0);
}

TEST(PointSolver, VisibilityBeforeTheHistoryDoesNotCount) {
  const scene::ScenarioDesc scenario = summer_day();
  const SurfaceClimate climate = climate_of(scenario);
  const std::vector<std::int64_t> times{4 * kHourNs, 8 * kHourNs};
  const auto plain = history(scenario, climate, kEast, {{4 * kHourNs, 1.0, 0.5}}, times);
  const auto early =
      history(scenario, climate, kEast,
              {{0, 0.0, 0.0}, {4 * kHourNs, 0.0, 0.0}, {4 * kHourNs, 1.0, 0.5}}, times);
  EXPECT_NEAR(early[0], plain[0], 1e-9);
  EXPECT_NEAR(early[1], plain[1], 1e-4);
}

TEST(PointSolver, AnswersAlikeWhateverPointCameBefore) {
  const scene::ScenarioDesc scenario = summer_day();
  const SurfaceClimate climate = climate_of(scenario);
  const auto mesh = reference::material_mesh(scenario.materials[0]);
  ASSERT_TRUE(mesh.has_value());
  PointSolver solver(climate, *mesh, scenario.materials[0], 292.0);
  const std::vector<std::int64_t> times{7 * kHourNs, 12 * kHourNs};
  std::vector<double> first(2);
  std::vector<double> other(2);
  std::vector<double> again(2);
  solver.run(kUp, {}, times, first);
  solver.run(kEast, {}, times, other);
  solver.run(kUp, {}, times, again);
  EXPECT_EQ(first, again);
  EXPECT_NE(first, other);
}

TEST(SurfaceClimate, StepOfTheForcingIsFineEnough) {
  const scene::ScenarioDesc scenario = summer_day();
  const std::vector<std::int64_t> times{5 * kHourNs, 7 * kHourNs, 11 * kHourNs, 14 * kHourNs};
  for (const glm::dvec3& normal : {kUp, kEast}) {
    const auto minute = history(scenario, climate_of(scenario), normal, {}, times);
    const auto quarter = history(scenario, climate_of(scenario, 15.0), normal, {}, times);
    for (std::size_t i = 0; i < times.size(); ++i) EXPECT_NEAR(minute[i], quarter[i], 2e-3);
  }
}

TEST(SurfaceClimate, KeepsJumpsAndStatedSurroundingsOfTheWeather) {
  scene::ScenarioDesc scenario = summer_day();
  scene::WeatherSample before;
  before.air_k = 290.0;
  before.environment_k = 280.0;
  before.film_w_m2_k = 7.0;
  scene::WeatherSample after = before;
  before.sim_time_ns = after.sim_time_ns = 6 * kHourNs;
  after.air_k = 300.0;
  after.environment_k = 305.0;
  scenario.weather = {before, after};
  const SurfaceClimate climate = climate_of(scenario);
  EXPECT_EQ(climate.start_ns(), -20 * kHourNs);
  EXPECT_NEAR(climate.at(6 * kHourNs - 1).air_k, 290.0, 1e-6);
  EXPECT_EQ(climate.at(6 * kHourNs).air_k, 300.0);
  EXPECT_EQ(climate.at(6 * kHourNs).surroundings_k, 305.0);
  EXPECT_EQ(climate.at(5 * kHourNs).surroundings_k, 280.0);
  EXPECT_EQ(physics::air_film(climate.at(5 * kHourNs).flow).stated_w_m2_k, 7.0);
  EXPECT_NEAR(climate.surroundings_reflectance_frac(), 0.1, 1e-12);
}

TEST(SurfaceClimate, NamesTheMaterialItLacks) {
  scene::ScenarioDesc scenario = summer_day();
  scenario.thermal.surroundings_material = "moss";
  const auto climate = SurfaceClimate::create(scenario, {});
  ASSERT_FALSE(climate.has_value());
  EXPECT_NE(climate.error().text.find("moss"), std::string::npos);
  scenario = summer_day();
  scenario.materials[0].layers.clear();
  const auto empty = SurfaceClimate::create(scenario, {});
  ASSERT_FALSE(empty.has_value());
  EXPECT_NE(empty.error().text.find("asphalt"), std::string::npos);
}

TEST(PointSolver, SheetIsDrivenByBothOfItsFaces) {
  scene::ScenarioDesc scenario = summer_day();
  scene::Material& material = scenario.materials[0];
  constexpr double kHalfM = 0.0005;
  material.layers = {{kHalfM, 50.0, 7850.0, 470.0}};
  material.base_k = 400.0;                              // a sheet must not use it
  const SurfaceClimate climate = climate_of(scenario);  // its ground is half a sheet too
  material.sheet = true;
  const auto mesh = reference::material_mesh(material);
  ASSERT_TRUE(mesh);
  PointSolver solver(climate, *mesh, material, 292.0);
  // The lower face lies in the shade throughout, the upper one from 9 o'clock on.
  const std::vector<ViewSample> up{{0, 1.0, 0.8}, {9 * kHourNs, 1.0, 0.8}, {9 * kHourNs, 0.0, 0.8}};
  const std::vector<ViewSample> down{{0, 0.0, 0.1}};
  const std::vector<std::int64_t> times{9 * kHourNs, 9 * kHourNs + 60'000'000'000, 11 * kHourNs};
  std::vector<double> from_above(times.size());
  std::vector<double> from_below(times.size());
  solver.run(kUp, {up, down}, times, from_above);
  solver.run(-kUp, {down, up}, times, from_below);
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_NEAR(from_above[i], from_below[i], 1e-4);
    const physics::FilmSkin skin = scene::film_skin(material);
    // Integrate the balance of both faces in steps of 0.1 s from an hour before.
    const auto net = [&](double now_s, double k) {
      const ClimateNode now = climate.at(static_cast<std::int64_t>(now_s * 1e9));
      const double rho = climate.surroundings_reflectance_frac();
      const ViewSample& lit = now_s < 9.0 * 3600.0 ? up[0] : up[2];
      const FaceState top = face_state(
          now, {kUp, material.solar_absorptance_frac, material.emissivity_frac, skin}, lit, rho);
      const FaceState bottom =
          face_state(now, {-kUp, material.solar_absorptance_frac, material.emissivity_frac, skin},
                     down[0], rho);
      return top.absorbed_w_m2 + bottom.absorbed_w_m2 -
             2.0 * material.emissivity_frac * sigma_t4(k) +
             (top.film_at_w_m2_k(k) + bottom.film_at_w_m2_k(k)) * (now.air_k - k);
    };
    const double end_s = static_cast<double>(times[i]) * 1e-9;
    double t_k = 300.0;
    for (double now_s = end_s - 3600.0; now_s < end_s - 0.05; now_s += 0.1) {
      t_k += 0.1 * net(now_s, t_k) / (2.0 * kHalfM * 7850.0 * 470.0);
    }
    EXPECT_NEAR(from_above[i], t_k, 0.02) << i;
  }
  EXPECT_LT(from_above[2], from_above[0] - 5.0);
}

TEST(PointSolver, PrescribedMaterialIsWhatItSays) {
  scene::ScenarioDesc scenario = summer_day();
  const SurfaceClimate climate = climate_of(scenario);
  scene::Material exhaust;
  exhaust.prescribed_k = 640.0;
  const auto t = point_history(climate, exhaust, 290.0, kUp, {}, std::vector<std::int64_t>{0});
  ASSERT_TRUE(t.has_value());
  EXPECT_EQ(t->front(), 640.0);
}

}  // namespace
}  // namespace emit
