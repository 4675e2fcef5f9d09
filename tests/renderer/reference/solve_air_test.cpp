// SPDX-License-Identifier: Apache-2.0
// Air past entities in the reference solution, against recovery temperatures and a plate's balance.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/ext/quaternion_double.hpp>
#include <string>
#include <utility>

#include "emit/physics/air_film.hpp"
#include "emit/physics/constants.hpp"
#include "emit/reference/solve.hpp"
#include "solid_scenes.hpp"

namespace emit::reference {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr double kGroundAirK = 285.0;
constexpr double kUpM = 3000.0;
constexpr double kLengthM = 2.0;
constexpr scene::Layer kSkin{0.001, 160.0, 2700.0, 900.0};
/// Heat of a face: the layers of a sheet reach from a face to its middle.
constexpr double kFaceJ_m2_k = 0.001 * 2700.0 * 900.0;

/// Thin level panel of bare metal that hardly radiates, and flies by the keyframes.
TestScene panel_scene(scene::Trajectory flight) {
  TestScene t;
  scene::Material skin;
  skin.name = "skin";
  skin.emissivity_frac = 0.001;
  skin.solar_absorptance_frac = 0.0;
  skin.layers = {kSkin};
  skin.sheet = true;
  t.geometry.materials = {skin};
  scene::Mesh panel;
  add_quad(panel, {{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}});
  finish_mesh(t, std::move(panel), 0);
  t.geometry.meshes[0].submeshes[0].double_sided = true;
  t.geometry.instances[0].entity_id = 7;
  t.geometry.interiors.resize(1);
  t.scenario.name = "panel";
  t.scenario.materials = t.geometry.materials;
  t.scenario.default_material = "skin";
  t.scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  t.scenario.objects.resize(1);
  t.scenario.objects[0].name = "panel";
  t.scenario.objects[0].entity_id = 7;
  t.scenario.objects[0].air_film = {physics::AirFilmShape::plate, kLengthM};
  t.scenario.objects[0].instances = {flight.front().pose};
  t.scenario.objects[0].trajectory = std::move(flight);
  t.scenario.thermal.initial_k = kGroundAirK;
  t.scenario.thermal.spin_up_ns = 3600 * kSecondNs;
  t.scenario.thermal.surroundings_material = "skin";
  t.scenario.atmosphere.enabled = false;
  scene::WeatherSample row;
  row.longwave_down_w_m2 = 200.0;
  row.air_k = kGroundAirK;
  row.environment_k = kGroundAirK;
  t.scenario.weather = {row};
  return t;
}

physics::Pose pose_at(double north_m) {
  return {{0.0, north_m, kUpM}, glm::dquat(1.0, 0.0, 0.0, 0.0)};
}

/// Temperature of the panel's middle, which is `north_m` from the place at that instant.
double panel_k(const TestScene& t, std::int64_t now_ns, double north_m) {
  SolveOptions options;
  options.dimension = SolveDimension::one;
  options.rays = 16;
  auto solver = SceneSolver::create(t.scenario, t.geometry, options, now_ns);
  EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
  if (!solver) return 0.0;
  for (const std::string& note : solver->report().notes) {
    EXPECT_EQ(note.find("film"), std::string::npos) << note;
  }
  const std::array<SolveProbe, 1> probes{
      {{{0.1, north_m + 0.2, kUpM}, glm::dvec3(0.0, 0.0, 1.0), "panel"}}};
  const auto points = solver->probe(probes, now_ns);
  EXPECT_TRUE(points.has_value()) << (points ? "" : points.error().text);
  return points ? (*points)[0].temperature_k : 0.0;
}

/// Air at the height of the flight: 6.5 K less per kilometre.
constexpr double kHighAirK = kGroundAirK - 0.0065 * kUpM;

TEST(ReferenceEntityAir, APanelTakesTheRecoveryTemperatureOfItsSpeed) {
  for (const double speed_m_s : {0.0, 150.0, 230.0}) {
    constexpr double kFlownS = 900.0;
    const double far_m = speed_m_s * kFlownS;
    const TestScene t =
        panel_scene({{0, pose_at(0.0), true},
                     {static_cast<std::int64_t>(kFlownS) * kSecondNs, pose_at(far_m), true}});
    const double mach = speed_m_s / std::sqrt(1.4 * 287.05 * kHighAirK);
    // Below Mach 0.3 the air is as warm as it is; the panel's own radiation is below 0.1 K.
    const double expected_k = kHighAirK * (1.0 + 0.178 * mach * mach);
    const double solved = panel_k(t, static_cast<std::int64_t>(kFlownS) * kSecondNs, far_m);
    EXPECT_NEAR(solved, expected_k, 0.15) << speed_m_s;
  }
}

TEST(ReferenceEntityAir, APanelThatStopsGoesBackAsItsFilmLetsIt) {
  // It flies south for ten minutes, and stands then.
  constexpr double kSpeedMPerS = 230.0;
  constexpr double kFlownS = 600.0;
  const double far_m = -kSpeedMPerS * kFlownS;
  const TestScene t =
      panel_scene({{0, pose_at(0.0), true},
                   {static_cast<std::int64_t>(kFlownS) * kSecondNs, pose_at(far_m), true},
                   {3600 * kSecondNs, pose_at(far_m), true}});
  const double mach = kSpeedMPerS / std::sqrt(1.4 * 287.05 * kHighAirK);
  double panel = kHighAirK * (1.0 + 0.178 * mach * mach);
  // Take the panel forward with the film of still air, that of a level plate of both sides.
  physics::AirFlow still;
  still.air_k = kGroundAirK;
  still = physics::raised_flow(still, kUpM);
  const physics::AirFilm film = physics::air_film(still, {physics::AirFilmShape::plate, kLengthM});
  int second = 0;
  for (const int after_s : {30, 300}) {
    for (; second < after_s; ++second) {
      const double excess_k = panel - kHighAirK;
      const double mean_w_m2_k = 0.5 * (physics::natural_film_w_m2_k(film, {}, 1.0, excess_k) +
                                        physics::natural_film_w_m2_k(film, {}, -1.0, excess_k));
      panel -= mean_w_m2_k * excess_k / kFaceJ_m2_k;
    }
    const std::int64_t now_ns = (static_cast<std::int64_t>(kFlownS) + after_s) * kSecondNs;
    EXPECT_NEAR(panel_k(t, now_ns, far_m), panel, 0.25) << after_s;
  }
}

TEST(ReferenceEntityAir, AJumpIsNoSpeed) {
  // It is somewhere else from the sixth minute on, as a teleport and by being off in between.
  TestScene still = panel_scene({{0, pose_at(0.0), true}});
  const double still_k = panel_k(still, 400 * kSecondNs, 0.0);
  scene::Trajectory jump{{0, pose_at(0.0), true}, {360 * kSecondNs, pose_at(90'000.0), true}};
  jump.back().teleport = true;
  EXPECT_NEAR(panel_k(panel_scene(jump), 400 * kSecondNs, 90'000.0), still_k, 0.02);
  const scene::Trajectory off{{0, pose_at(0.0), true},
                              {350 * kSecondNs, pose_at(0.0), false},
                              {360 * kSecondNs, pose_at(90'000.0), true}};
  EXPECT_NEAR(panel_k(panel_scene(off), 400 * kSecondNs, 90'000.0), still_k, 0.02);
}

}  // namespace
}  // namespace emit::reference
