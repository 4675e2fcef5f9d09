// SPDX-License-Identifier: Apache-2.0
// Interiors of bodies in the reference solution, against the heat balance of shell and interior.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/ext/quaternion_double.hpp>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/solve.hpp"
#include "solid_scenes.hpp"

namespace emit::reference {
namespace {

constexpr std::int64_t kMinuteNs = 60'000'000'000;
constexpr double kStartK = 300.0;
constexpr double kNightAirK = 260.0;
constexpr double kFilmW_m2_k = 13.0;
constexpr double kEmissivity = 0.9;
constexpr scene::Layer kSteel{0.0015, 50.0, 7850.0, 470.0};
constexpr scene::Layer kInside{0.02, 0.16, 1.2, 1005.0};
constexpr double kInsideW_m2_k = 1.0 / (0.0015 / 50.0 + 0.02 / 0.16);

/// Box of steel high in the air, by night, on which nothing but air, sky and surroundings act. The
/// box is scenery, or an entity that stands still.
TestScene box_scene(const scene::BodyInterior& interior, double sky_w_m2, bool entity) {
  TestScene t;
  scene::Material steel;
  steel.name = "steel";
  steel.emissivity_frac = kEmissivity;
  steel.layers = {kSteel, kInside};
  steel.base = scene::BaseKind::body;
  steel.base_k = kStartK;
  t.geometry.materials = {steel};
  scene::Mesh body;
  const glm::dvec3 up(0.0, 0.0, entity ? 0.0 : 4.0);
  add_box(body, glm::dvec3(-1.0, -1.0, -1.0) + up, glm::dvec3(1.0, 1.0, 1.0) + up);
  finish_mesh(t, std::move(body), 0);
  t.geometry.interiors = {interior};
  t.scenario.name = "box";
  t.scenario.materials = t.geometry.materials;
  t.scenario.default_material = "steel";
  t.scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  t.scenario.objects.resize(1);
  t.scenario.objects[0].name = "box";
  if (entity) {
    t.geometry.instances[0].entity_id = 7;
    t.scenario.objects[0].entity_id = 7;
    t.scenario.objects[0].instances = {
        physics::Pose{{0.0, 0.0, 4.0}, glm::dquat(1.0, 0.0, 0.0, 0.0)}};
  }
  t.scenario.thermal.initial_k = kStartK;
  t.scenario.thermal.spin_up_ns = 0;
  t.scenario.thermal.surroundings_material = "steel";
  t.scenario.atmosphere.enabled = false;
  scene::WeatherSample row;
  row.longwave_down_w_m2 = sky_w_m2;
  row.air_k = kNightAirK;
  row.environment_k = kNightAirK;
  row.film_w_m2_k = kFilmW_m2_k;
  t.scenario.weather = {row};
  return t;
}

/// Temperatures of the middles of roof and southern side.
std::array<double, 2> solved_k(const TestScene& t, std::int64_t now_ns) {
  SolveOptions options;
  options.dimension = SolveDimension::one;
  options.rays = 64;
  auto solver = SceneSolver::create(t.scenario, t.geometry, options, now_ns);
  EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
  if (!solver) return {};
  const std::array<SolveProbe, 2> probes{{{{0.0, 0.0, 5.0}, glm::dvec3(0.0, 0.0, 1.0), ""},
                                          {{0.0, -1.0, 4.0}, glm::dvec3(0.0, -1.0, 0.0), ""}}};
  const auto points = solver->probe(probes, now_ns);
  EXPECT_TRUE(points.has_value()) << (points ? "" : points.error().text);
  if (!points) return {};
  for (const std::string& note : solver->report().notes) {
    EXPECT_EQ(note.find("interior"), std::string::npos) << note;
  }
  return {(*points)[0].temperature_k, (*points)[1].temperature_k};
}

TEST(ReferenceInteriors, CoolDownWithTheirInteriorAsTheHeatBalanceSays) {
  for (const bool entity : {false, true}) {
    for (const scene::BodyInterior& interior :
         {scene::BodyInterior{}, scene::BodyInterior{40'000.0, 0.0},
          scene::BodyInterior{1'000.0, 20.0}}) {
      // Take shell and interior forward in steps of a second.
      const double shell_j_m2_k =
          kSteel.thickness_m * kSteel.density_kg_m3 * kSteel.specific_heat_j_kg_k;
      double shell_k = kStartK;
      double interior_k = kStartK;
      int second = 0;
      for (const int minutes : {20, 120}) {
        for (; second < 60 * minutes; ++second) {
          const double inwards_w_m2 = kInsideW_m2_k * (shell_k - interior_k);
          shell_k += (kEmissivity * (black_w_m2(kNightAirK) - black_w_m2(shell_k)) +
                      kFilmW_m2_k * (kNightAirK - shell_k) - inwards_w_m2) /
                     shell_j_m2_k;
          interior_k += (inwards_w_m2 + interior.ventilation_w_m2_k * (kNightAirK - interior_k)) /
                        interior.heat_j_m2_k;
        }
        const auto [roof_k, side_k] =
            solved_k(box_scene(interior, black_w_m2(kNightAirK), entity), minutes * kMinuteNs);
        SCOPED_TRACE(testing::Message()
                     << interior.heat_j_m2_k << " J/m2K, " << minutes << " min, entity " << entity);
        // The balance leaves out the film's 24 J/m2/K, which is 0.4 % of the shell's.
        EXPECT_NEAR(roof_k, shell_k, 0.1);
        EXPECT_NEAR(side_k, shell_k, 0.1);
      }
    }
  }
}

/// Returns the zero of a falling function.
double zero_of(const std::function<double(double)>& falls) {
  double low = 100.0;
  double high = 400.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (falls(middle) > 0.0 ? low : high) = middle;
  }
  return low;
}

TEST(ReferenceInteriors, PassHeatFromFaceToFaceThroughTheirInterior) {
  constexpr double kSkyW_m2 = 100.0;
  const scene::BodyInterior interior;
  // Find the steady faces behind which all have one interior.
  const auto face_k = [&](double sky_frac, double interior_k) {
    return zero_of([&](double k) {
      return kEmissivity *
                 (sky_frac * kSkyW_m2 + (1.0 - sky_frac) * black_w_m2(kNightAirK) - black_w_m2(k)) +
             kFilmW_m2_k * (kNightAirK - k) + kInsideW_m2_k * (interior_k - k);
    });
  };
  const double interior_k = zero_of([&](double k) {
    const auto into = [&](double sky_frac) { return kInsideW_m2_k * (face_k(sky_frac, k) - k); };
    return into(1.0) + 4.0 * into(0.5) + into(0.0) +
           6.0 * interior.ventilation_w_m2_k * (kNightAirK - k);
  });
  const auto [roof_k, side_k] = solved_k(box_scene(interior, kSkyW_m2, false), 720 * kMinuteNs);
  EXPECT_NEAR(roof_k, face_k(1.0, interior_k), 0.05);
  EXPECT_NEAR(side_k, face_k(0.5, interior_k), 0.05);
  // An interior that is held where it starts would show.
  EXPECT_GT(std::abs(roof_k - face_k(1.0, kStartK)), 5.0);
}

TEST(ReferenceInteriors, OfOneObjectHaveInteriorsOfTheirOwn) {
  // The second placement has a heavy skin that begins hot.
  TestScene t = box_scene({}, black_w_m2(kNightAirK), false);
  const double alone_k = solved_k(t, 120 * kMinuteNs)[0];
  scene::Mesh other = t.geometry.meshes[0];
  for (glm::vec3& p : other.positions_m) p.x += 50.0F;
  other.bounds = {};
  for (const glm::vec3& p : other.positions_m) other.bounds.add(glm::dvec3(p));
  scene::Material hot = t.geometry.materials[0];
  hot.name = "hot";
  hot.layers = {{0.02, 50.0, 7850.0, 470.0}, kInside};
  hot.initial_k = 400.0;
  t.geometry.materials.push_back(hot);
  t.scenario.materials = t.geometry.materials;
  finish_mesh(t, std::move(other), 1);
  t.geometry.instances[1].placement = 1;
  EXPECT_NEAR(solved_k(t, 120 * kMinuteNs)[0], alone_k, 0.01);
  // Faces of one placement have one interior.
  t.geometry.instances[1].placement = 0;
  EXPECT_GT(solved_k(t, 120 * kMinuteNs)[0], alone_k + 1.0);
}

TEST(ReferenceInteriors, AnEntityThatStandsExchangesRadiationLikeScenery) {
  // A box stands over ground that is as warm as the day before, in the cold of a clear night.
  const auto scene_of = [](bool entity) {
    TestScene t = box_scene({}, 150.0, entity);
    scene::Material ground = t.geometry.materials[0];
    ground.name = "ground";
    ground.emissivity_frac = 0.95;
    ground.layers = {{0.5, 1.5, 2200.0, 900.0}};
    ground.base = scene::BaseKind::air;
    ground.base_k = kStartK;
    t.geometry.materials.push_back(ground);
    t.scenario.materials = t.geometry.materials;
    scene::Mesh floor;
    add_quad(floor, {{{-8, -8, 2.5}, {8, -8, 2.5}, {8, 8, 2.5}, {-8, 8, 2.5}}});
    finish_mesh(t, std::move(floor), 1);
    t.geometry.instances[1].object = 1;
    t.scenario.objects.resize(2);
    t.scenario.objects[1].name = "floor";
    t.geometry.interiors.resize(2);
    return t;
  };
  constexpr std::int64_t kNowNs = 120 * kMinuteNs;
  const std::array<SolveProbe, 3> probes{{{{0.1, 0.2, 2.5}, glm::dvec3(0.0, 0.0, 1.0), "floor"},
                                          {{0.1, 0.2, 3.0}, glm::dvec3(0.0, 0.0, -1.0), "box"},
                                          {{0.0, -1.0, 3.3}, glm::dvec3(0.0, -1.0, 0.0), "box"}}};
  const auto kelvin = [&](TestScene t, bool exchange) {
    std::array<double, 3> all{};
    t.scenario.thermal.exchange = exchange;
    SolveOptions options;
    options.dimension = SolveDimension::one;
    options.rays = 128;
    auto solver = SceneSolver::create(t.scenario, t.geometry, options, kNowNs);
    EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
    if (!solver) return all;
    const auto points = solver->probe(probes, kNowNs);
    EXPECT_TRUE(points.has_value());
    for (std::size_t i = 0; points && i < all.size(); ++i) all[i] = (*points)[i].temperature_k;
    return all;
  };
  const auto scenery = kelvin(scene_of(false), true);
  const auto entity = kelvin(scene_of(true), true);
  const auto alone = kelvin(scene_of(true), false);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    EXPECT_NEAR(entity[i], scenery[i], 0.03) << i;
    EXPECT_GT(std::abs(scenery[i] - alone[i]), 0.5) << i;
  }
  // A box that came a minute ago has left the ground as it is without one.
  TestScene came = scene_of(true);
  const physics::Pose there{{0.0, 0.0, 4.0}, glm::dquat(1.0, 0.0, 0.0, 0.0)};
  const physics::Pose away{{0.0, 500.0, 4.0}, glm::dquat(1.0, 0.0, 0.0, 0.0)};
  came.scenario.objects[0].trajectory = {{0, away, true},
                                         {kNowNs - kMinuteNs - 1'000'000'000, away, true},
                                         {kNowNs - kMinuteNs, there, true}};
  // One that has just left is remembered, though the picture no longer shows it.
  TestScene left = came;
  left.scenario.objects[0].trajectory = {{0, there, true},
                                         {kNowNs - kMinuteNs - 1'000'000'000, there, true},
                                         {kNowNs - kMinuteNs, away, true}};
  EXPECT_GT(kelvin(left, true)[0] - kelvin(left, false)[0], 0.5 * (scenery[0] - alone[0]));
  TestScene open = scene_of(true);
  open.scenario.objects[0].instances = {away};
  const auto now = kelvin(came, true);
  EXPECT_NEAR(now[0], kelvin(open, true)[0], 0.25 * std::abs(scenery[0] - kelvin(open, true)[0]));
}

}  // namespace
}  // namespace emit::reference
