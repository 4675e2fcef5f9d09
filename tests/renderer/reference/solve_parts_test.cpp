// SPDX-License-Identifier: Apache-2.0
// Parts of entities with a prescribed temperature in the reference solution, against view factors.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/ext/quaternion_double.hpp>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/reference/solve.hpp"
#include "solid_scenes.hpp"

namespace emit::reference {
namespace {

constexpr std::int64_t kNowNs = 7200'000'000'000;
constexpr double kAroundK = 290.0;
constexpr double kHotK = 800.0;
constexpr double kHotEmissivity = 0.9;
constexpr double kSheetFilmW_m2_k = 10.0;

/// View factor from a small face to a parallel rectangle of sides 2a and 2b whose middle stands
/// `away_m` before it (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3).
double rectangle_frac(double a_m, double b_m, double away_m) {
  const double a = a_m / away_m;
  const double b = b_m / away_m;
  const double root_a = std::sqrt(1.0 + a * a);
  const double root_b = std::sqrt(1.0 + b * b);
  return 2.0 / physics::kPi *
         (a / root_a * std::atan(b / root_a) + b / root_b * std::atan(a / root_b));
}

/// Small black sheet at the origin, and a hot plate of an entity that looks down on it.
TestScene plate_scene(double a_m, double b_m, double away_m) {
  TestScene t;
  scene::Material sheet;
  sheet.name = "sheet";
  sheet.emissivity_frac = 1.0;
  sheet.layers = {{0.001, 160.0, 2700.0, 900.0}};
  sheet.sheet = true;
  scene::Material hot = sheet;
  hot.name = "hot";
  hot.sheet = false;
  hot.emissivity_frac = kHotEmissivity;
  hot.prescribed_k = kHotK;
  scene::Material screen = hot;
  screen.name = "screen";
  screen.emissivity_frac = 1.0;
  screen.prescribed_k = kAroundK;
  t.geometry.materials = {sheet, hot, screen};
  scene::Mesh small;
  add_quad(small, {{{-.01, -.01, 0}, {.01, -.01, 0}, {.01, .01, 0}, {-.01, .01, 0}}});
  finish_mesh(t, std::move(small), 0);
  t.geometry.meshes[0].submeshes[0].double_sided = true;
  scene::Mesh plate;
  add_quad(plate, {{{-a_m, -b_m, 0}, {-a_m, b_m, 0}, {a_m, b_m, 0}, {a_m, -b_m, 0}}});
  finish_mesh(t, std::move(plate), 1);
  t.geometry.instances[1].object = 1;
  t.geometry.instances[1].entity_id = 3;
  t.geometry.interiors.resize(2);
  t.scenario.name = "plate";
  t.scenario.materials = t.geometry.materials;
  t.scenario.default_material = "sheet";
  t.scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  t.scenario.objects.resize(2);
  t.scenario.objects[0].name = "small";
  t.scenario.objects[1].name = "plate";
  t.scenario.objects[1].entity_id = 3;
  t.scenario.objects[1].instances = {{{0.0, 0.0, away_m}, glm::dquat(1.0, 0.0, 0.0, 0.0)}};
  t.scenario.thermal.initial_k = kAroundK;
  t.scenario.thermal.spin_up_ns = 0;
  t.scenario.thermal.exchange = true;
  t.scenario.thermal.surroundings_material = "sheet";
  t.scenario.atmosphere.enabled = false;
  scene::WeatherSample row;
  row.longwave_down_w_m2 = black_w_m2(kAroundK);
  row.air_k = kAroundK;
  row.environment_k = kAroundK;
  row.film_w_m2_k = kSheetFilmW_m2_k;
  t.scenario.weather = {row};
  return t;
}

double sheet_k(const TestScene& t, std::uint32_t rays) {
  SolveOptions options;
  options.dimension = SolveDimension::one;
  options.rays = rays;
  auto solver = SceneSolver::create(t.scenario, t.geometry, options, kNowNs);
  EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
  if (!solver) return 0.0;
  const std::array<SolveProbe, 1> probes{{{{0.002, 0.001, 0.0}, glm::dvec3(0, 0, 1), "small"}}};
  const auto points = solver->probe(probes, kNowNs);
  EXPECT_TRUE(points.has_value()) << (points ? "" : points.error().text);
  return points ? (*points)[0].temperature_k : 0.0;
}

/// Steady temperature of the sheet, whose upper face sees a share of the plate.
double steady_k(double share_frac) {
  const double lit = share_frac * (kHotEmissivity * black_w_m2(kHotK) - black_w_m2(kAroundK));
  double low = 200.0;
  double high = 900.0;
  for (int i = 0; i < 60; ++i) {
    const double k = 0.5 * (low + high);
    const double in =
        0.5 * lit + black_w_m2(kAroundK) - black_w_m2(k) + kSheetFilmW_m2_k * (kAroundK - k);
    (in > 0.0 ? low : high) = k;
  }
  return low;
}

TEST(ReferenceParts, OfAnySizeHeatByTheirViewFactor) {
  struct Case {
    double a_m, b_m, away_m;
  };
  // The share of the last is 8e-6: no ray of 64 would ever meet it.
  for (const Case& c :
       {Case{2.0, 3.0, 0.5}, Case{0.5, 0.5, 1.5}, Case{0.1, 0.05, 1.0}, Case{0.1, 0.1, 40.0}}) {
    const double share = rectangle_frac(c.a_m, c.b_m, c.away_m);
    const double expected = steady_k(share);
    const double solved = sheet_k(plate_scene(c.a_m, c.b_m, c.away_m), 64);
    // The plate hides sky and surroundings of the sheet's own temperature only by samples of rays.
    EXPECT_NEAR(solved - kAroundK, expected - kAroundK, 0.01 + 0.01 * (expected - kAroundK))
        << share;
  }
}

TEST(ReferenceParts, AreHiddenByWhatStandsBeforeThem) {
  // A screen of the temperature of the surroundings hides one half, and then all.
  for (const double edge_m : {0.0, -5.0}) {
    TestScene t = plate_scene(0.5, 0.5, 1.5);
    scene::Mesh screen;
    add_quad(screen, {{{edge_m, -5, 0.7}, {edge_m, 5, 0.7}, {5, 5, 0.7}, {5, -5, 0.7}}});
    finish_mesh(t, std::move(screen), 2);
    t.geometry.instances[2].object = 0;
    const double share = edge_m < 0.0 ? 0.0 : 0.5 * rectangle_frac(0.5, 0.5, 1.5);
    const double expected = steady_k(share);
    EXPECT_NEAR(sheet_k(t, 256) - kAroundK, expected - kAroundK,
                0.05 + 0.04 * (expected - kAroundK))
        << edge_m;
  }
}

TEST(ReferenceParts, DoNotHeatWhatLooksAtTheirBacks) {
  TestScene t = plate_scene(0.5, 0.5, 1.5);
  for (glm::vec3& p : t.geometry.meshes[1].positions_m) p.x = -p.x;
  EXPECT_NEAR(sheet_k(t, 64), kAroundK, 0.05);
}

}  // namespace
}  // namespace emit::reference
