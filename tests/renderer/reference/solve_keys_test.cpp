// SPDX-License-Identifier: Apache-2.0
// Keys of a scenario that the reference solution honours or refuses by name.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>

#include "emit/physics/constants.hpp"
#include "emit/reference/solve.hpp"
#include "solid_scenes.hpp"

namespace emit::reference {
namespace {

/// Returns a wall and a plate of steel before it, which stand on ground, on a summer's forenoon.
TestScene wall_scene() {
  TestScene t;
  scene::Material ground;
  ground.name = "ground";
  ground.solar_absorptance_frac = 0.8;
  ground.emissivity_frac = 0.95;
  ground.layers = {{0.10, 0.7, 2000.0, 900.0}};
  ground.base_k = 290.0;
  scene::Material wall = ground;
  wall.name = "wall";
  wall.layers = {{0.05, 1.2, 2200.0, 880.0}};
  t.geometry.materials = {ground, wall};
  scene::Mesh floor;
  add_quad(floor, {{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}});
  finish_mesh(t, std::move(floor), 0);
  scene::Mesh body;
  add_box(body, {-0.5, -0.1, 0.0}, {0.5, 0.1, 0.6});
  finish_mesh(t, std::move(body), 1);
  t.scenario.name = "keys";
  t.scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  t.scenario.epoch_utc_ns = 1403330400LL * 1'000'000'000LL;  // the date is 2014-06-21T06:00:00Z
  t.scenario.materials = t.geometry.materials;
  t.scenario.default_material = "ground";
  t.scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  t.scenario.objects.resize(1);
  t.scenario.objects[0].name = "scene";
  t.scenario.thermal.initial_k = 290.0;
  t.scenario.atmosphere.enabled = false;
  return t;
}

SolveOptions quick_options() {
  SolveOptions options;
  options.refine = 0.15;
  options.tolerance_k = 0.003;
  options.rays = 64;
  return options;
}

constexpr std::int64_t kEndNs = 3'600'000'000'000;
/// Point of the ground before the south side of the wall.
const SolveProbe kFoot{{0.0, -0.13, 0.0}, glm::dvec3(0.0, 0.0, 1.0), "scene"};

double foot_k(const TestScene& t, const SolveOptions& options) {
  auto solver = SceneSolver::create(t.scenario, t.geometry, options, kEndNs);
  EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
  if (!solver) return std::nan("");
  EXPECT_TRUE(solver->advance_to(kEndNs).has_value());
  const auto points = solver->probe(std::span(&kFoot, 1), kEndNs);
  EXPECT_TRUE(points.has_value());
  return points ? (*points)[0].temperature_k : std::nan("");
}

TEST(ReferenceKeys, ExchangeSwitchedOffTakesTheWallForSurroundings) {
  TestScene t = wall_scene();
  const double with_k = foot_k(t, quick_options());
  t.scenario.thermal.exchange = false;
  const double without_k = foot_k(t, quick_options());
  EXPECT_TRUE(std::isfinite(with_k + without_k));
  EXPECT_GT(std::abs(with_k - without_k), 0.1);
}

TEST(ReferenceKeys, OneDimensionExchangesAsThreeDoAwayFromEdges) {
  // The points lie farther from foot and edges than the ground and the wall are thick.
  TestScene t = wall_scene();
  t.geometry.meshes.pop_back();
  t.geometry.instances.pop_back();
  scene::Mesh body;
  add_box(body, {-0.9, 0.0, 0.0}, {0.9, 0.3, 1.0});
  finish_mesh(t, std::move(body), 1);
  t.geometry.materials[1].solar_absorptance_frac = 0.6;
  t.geometry.materials[1].emissivity_frac = 0.7;
  t.geometry.materials[1].layers = {{0.10, 1.2, 2200.0, 880.0}};
  // The surroundings are cooler than the ground, which the wall sees.
  t.geometry.materials.push_back(t.geometry.materials[1]);
  t.geometry.materials[2].name = "around";
  t.geometry.materials[2].solar_absorptance_frac = 0.3;
  t.scenario.materials = t.geometry.materials;
  t.scenario.thermal.surroundings_material = "around";
  t.scenario.epoch_utc_ns += 3LL * 3600 * 1'000'000'000;
  const std::array<SolveProbe, 3> probes{{{{0.0, -0.25, 0.0}, glm::dvec3(0.0, 0.0, 1.0), ""},
                                          {{0.1, -0.4, 0.0}, glm::dvec3(0.0, 0.0, 1.0), ""},
                                          {{0.0, 0.0, 0.5}, glm::dvec3(0.0, -1.0, 0.0), ""}}};
  SolveOptions options = quick_options();
  options.refine = 0.3;
  options.rays = 1024;
  const auto kelvin = [&](SolveDimension dimension, bool exchange) {
    options.dimension = dimension;
    t.scenario.thermal.exchange = exchange;
    std::array<double, 3> all{};
    auto solver = SceneSolver::create(t.scenario, t.geometry, options, kEndNs);
    EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
    if (!solver || !solver->advance_to(kEndNs)) return all;
    const auto points = solver->probe(probes, kEndNs);
    EXPECT_TRUE(points.has_value());
    for (std::size_t i = 0; points && i < 3; ++i) all[i] = (*points)[i].temperature_k;
    return all;
  };
  const auto one = kelvin(SolveDimension::one, true);
  const auto three = kelvin(SolveDimension::three, true);
  const auto one_without = kelvin(SolveDimension::one, false);
  const auto three_without = kelvin(SolveDimension::three, false);
  for (std::size_t i = 0; i < 3; ++i) {
    RecordProperty("one_" + std::to_string(i), std::to_string(one[i]));
    RecordProperty("three_" + std::to_string(i), std::to_string(three[i]));
    RecordProperty("one_without_" + std::to_string(i), std::to_string(one_without[i]));
    RecordProperty("three_without_" + std::to_string(i), std::to_string(three_without[i]));
    // Conduction sideways is the same in both; what exchange adds is compared.
    const double adds = one[i] - one_without[i];
    const double should_add = three[i] - three_without[i];
    EXPECT_GT(std::abs(should_add), 0.3) << i;
    EXPECT_NEAR(adds, should_add, 0.08 * std::abs(should_add) + 0.02) << i;
  }
}

TEST(ReferenceKeys, CheckpointOfAnotherKeyIsRefusedByName) {
  TestScene t = wall_scene();
  SolveOptions options = quick_options();
  options.checkpoint =
      std::filesystem::path(EMIT_TEST_BINARY_DIR) / "tests" / "reference_keys_checkpoint";
  std::filesystem::remove_all(options.checkpoint);
  ASSERT_TRUE(std::isfinite(foot_k(t, options)));
  const auto refusal = [&](const TestScene& changed, const SolveOptions& with) -> std::string {
    auto solver = SceneSolver::create(changed.scenario, changed.geometry, with, kEndNs);
    if (!solver) return solver.error().text;
    const auto reached = solver->advance_to(kEndNs);
    return reached ? "" : reached.error().text;
  };
  EXPECT_EQ(refusal(t, options), "");
  TestScene changed = t;
  changed.scenario.thermal.exchange = false;
  EXPECT_NE(refusal(changed, options).find("thermal.exchange"), std::string::npos);
  changed = t;
  changed.scenario.contacts = {{{"wall", "ground"}, 0.1}};
  EXPECT_NE(refusal(changed, options).find("contacts"), std::string::npos);
  changed = t;
  changed.geometry.materials[1].initial_k = 280.0;
  EXPECT_NE(refusal(changed, options).find("materials"), std::string::npos);
  SolveOptions other = options;
  other.rays = 65;
  EXPECT_NE(refusal(t, other).find("rays"), std::string::npos);
}

TEST(ReferenceKeys, AutomaticDimensionSaysWhy) {
  TestScene t = wall_scene();
  SolveOptions options = quick_options();
  const auto reason = [&](const TestScene& of) {
    const auto solver = SceneSolver::create(of.scenario, of.geometry, options, kEndNs);
    EXPECT_TRUE(solver.has_value());
    return solver ? solver->report() : SolveReport{};
  };
  EXPECT_EQ(reason(t).dimension, 3);
  EXPECT_NE(reason(t).reason.find("axis"), std::string::npos);
  TestScene open = t;
  open.geometry.meshes[1].submeshes[0].index_count -= 6;
  EXPECT_EQ(reason(open).dimension, 1);
  EXPECT_NE(reason(open).reason.find("object 'scene'"), std::string::npos);
  EXPECT_TRUE(reason(open).notes.empty());
  open.scenario.contacts = {{{"wall", "ground"}, 0.1}};
  ASSERT_EQ(reason(open).notes.size(), 1U);
  EXPECT_NE(reason(open).notes[0].find("[[contact]]"), std::string::npos);
  // Interiors and parts that heat themselves are named in any dimension.
  t.geometry.materials[1].base = scene::BaseKind::body;
  t.scenario.objects[0].parts.resize(1);
  ASSERT_EQ(reason(t).notes.size(), 2U);
  EXPECT_NE(reason(t).notes[0].find("'wall'"), std::string::npos);
  EXPECT_NE(reason(t).notes[1].find("[[object.parts]]"), std::string::npos);
}

TEST(ReferenceKeys, SpinUpKnowsTheShadeOfTheWall) {
  // The ground just north of the wall lacks the sun of the forenoon, all of which lies in the
  // spin-up.
  TestScene t = wall_scene();
  t.scenario.epoch_utc_ns += 5LL * 3600 * 1'000'000'000;
  t.scenario.thermal.history_start_ns = 0;
  t.scenario.thermal.spin_up_ns = 24LL * 3600 * 1'000'000'000;
  SolveOptions options = quick_options();
  options.spin_up_s = 24.0 * 3600.0;
  const std::array<SolveProbe, 2> probes{{{{0.0, 0.13, 0.0}, glm::dvec3(0.0, 0.0, 1.0), ""},
                                          {{0.0, 0.85, 0.0}, glm::dvec3(0.0, 0.0, 1.0), ""}}};
  for (const SolveDimension dimension : {SolveDimension::three, SolveDimension::one}) {
    options.dimension = dimension;
    auto solver = SceneSolver::create(t.scenario, t.geometry, options, 0);
    ASSERT_TRUE(solver.has_value()) << solver.error().text;
    ASSERT_TRUE(solver->advance_to(0).has_value());
    const auto points = solver->probe(probes, 0);
    ASSERT_TRUE(points.has_value()) << points.error().text;
    EXPECT_GT((*points)[1].temperature_k, (*points)[0].temperature_k + 3.0);
    EXPECT_EQ(solver->report().spin_up_s, 24.0 * 3600.0);
  }
}

TEST(ReferenceKeys, DaysBeforeTheLastOneOnTheCoarseGridLeaveNoMark) {
  TestScene t = wall_scene();
  t.scenario.thermal.history_start_ns = -40LL * 3600 * 1'000'000'000;
  t.scenario.thermal.spin_up_ns = 3600LL * 1'000'000'000;
  SolveOptions options = quick_options();
  options.spin_up_s = 3600.0;
  const double fine_k = foot_k(t, options);
  options.first_ns = kEndNs;
  EXPECT_NEAR(foot_k(t, options), fine_k, 0.05);
}

TEST(ReferenceKeys, ProbeOfNothingIsNotANumber) {
  const TestScene t = wall_scene();
  auto solver = SceneSolver::create(t.scenario, t.geometry, quick_options(), 0);
  ASSERT_TRUE(solver.has_value());
  ASSERT_TRUE(solver->advance_to(0).has_value());
  std::array<SolveProbe, 3> probes{};
  probes[0].position_m = {0.0, 0.0, 2.0};
  probes[1].position_m = {0.0, 0.0, 0.605};
  probes[2] = probes[1];
  probes[2].normal = glm::dvec3(0.0, 1.0, 0.0);
  const auto points = solver->probe(probes, 0);
  ASSERT_TRUE(points.has_value());
  EXPECT_TRUE(std::isnan((*points)[0].temperature_k));
  EXPECT_NEAR((*points)[1].position_m.z, 0.6, 1e-6);
  EXPECT_NEAR((*points)[1].temperature_k, 290.0, 1e-6);
  EXPECT_TRUE(std::isnan((*points)[2].temperature_k));
}

TEST(ReferenceKeys, NotesNameTheLimitsThatWeatherAndTemperaturesPass) {
  const auto notes_of = [](double air_k, double rain_mm_h, double wind_m_s, bool humidity,
                           const char* family, double sky_frac = 1.0) {
    TestScene t = wall_scene();
    scene::Material& ground = t.geometry.materials[0];
    if (*family == '\0') ground.water_store_mm = 0.5;
    ground.family = family;
    ground.base_k = t.geometry.materials[1].base_k = t.scenario.thermal.initial_k = air_k;
    t.scenario.materials = t.geometry.materials;
    for (const std::int64_t hour : {-400, 0, 1, 10}) {
      scene::WeatherSample row;
      row.sim_time_ns = hour * kEndNs;
      row.longwave_down_w_m2 = sky_frac * black_w_m2(air_k);
      row.air_k = air_k;
      row.wind_m_s = wind_m_s;
      if (humidity) row.relative_humidity_frac = 0.9;
      row.rain_mm_h = hour == 1 ? rain_mm_h : 0.0;
      t.scenario.weather.push_back(row);
    }
    SolveOptions options = quick_options();
    options.dimension = SolveDimension::one;
    options.spin_up_s = 7200.0;
    auto solver = SceneSolver::create(t.scenario, t.geometry, options, kEndNs);
    EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
    if (!solver) return std::string();
    // Twice the same says it once.
    for (int i = 0; i < 2; ++i) {
      EXPECT_TRUE(solver->probe(std::span(&kFoot, 1), kEndNs).has_value());
    }
    std::string names;
    for (const std::string& note : solver->report().notes) {
      names += note.substr(0, note.find(':')) + " ";
    }
    return names;
  };
  EXPECT_EQ(notes_of(285.0, 0.0, 3.0, true, ""), "");
  EXPECT_EQ(notes_of(285.0, 0.0, 3.0, false, ""), "");
  EXPECT_EQ(notes_of(285.0, 0.0, 3.0, true, "", 0.45), "");
  EXPECT_EQ(notes_of(285.0, 0.0, 3.0, true, "", 0.0), "longwave_low ");
  EXPECT_EQ(notes_of(285.0, 2.0, 3.0, true, ""), "rain_unknown ");  // the top of the wall
  EXPECT_EQ(notes_of(265.0, 2.0, 25.0, false, ""),
            "snowfall strong_wind humidity_unknown rain_unknown freezing ");
  EXPECT_EQ(notes_of(265.0, 0.0, 3.0, true, "water, snow and ice"), "");
  EXPECT_EQ(notes_of(280.0, 0.0, 3.0, true, "water, snow and ice"), "melting ");
}

}  // namespace
}  // namespace emit::reference
