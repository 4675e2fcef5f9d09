// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "bench/accuracy/converged_model.hpp"
#include "bench/accuracy/converged_views.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"
#include "emit/physics/surface_balance.hpp"
#include "support/times.hpp"

namespace emit::tool {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kEndNs = 7200 * kSecondNs;

scene::Material stone() {
  scene::Material out;
  out.name = "stone";
  out.solar_absorptance_frac = 0.6;
  out.emissivity_frac = 0.92;
  out.layers = {{0.1, 2.4, 2600, 830}};
  out.base_k = 293.15;
  out.modes = {{200.0, 0.4}, {3000.0, 0.6}};
  return out;
}

/// Scenario of 21 June at 48.56 N under a clear sky from 07:00 UTC on.
scene::ScenarioDesc scenario(scene::ThermalModel model) {
  scene::ScenarioDesc s;
  s.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  s.epoch_utc_ns = 1403334000LL * kSecondNs;
  s.materials = {stone()};
  s.default_material = "stone";
  s.thermal.model = model;
  s.thermal.initial_k = 293.15;
  if (model == scene::ThermalModel::foster) s.thermal.spin_up_ns = 172'800 * kSecondNs;
  return s;
}

std::vector<std::int64_t> uniform_nodes(std::size_t steps) {
  std::vector<std::int64_t> nodes;
  for (std::size_t i = 0; i <= steps; ++i) {
    nodes.push_back(kEndNs * static_cast<std::int64_t>(i) / static_cast<std::int64_t>(steps));
  }
  return nodes;
}

/// Views of level ground that a shadow crosses: its edge takes four minutes to pass.
std::vector<PointView> crossed(std::span<const std::int64_t> nodes_ns, double open_frac) {
  std::vector<PointView> out;
  for (const std::int64_t t : nodes_ns) {
    const double s = 1e-9 * static_cast<double>(t);
    const double shade =
        std::clamp((s - 3000.0) / 240.0, 0.0, 1.0) * std::clamp((6000.0 - s) / 240.0, 0.0, 1.0);
    out.push_back({{0.0, 0.0, 1.0}, 1.0 - shade, open_frac});
  }
  return out;
}

double ground_k(scene::ThermalModel model, std::size_t steps) {
  const auto s = scenario(model);
  const auto nodes = uniform_nodes(steps);
  const auto made = ConvergedModel::create(s, s.materials, nodes);
  EXPECT_TRUE(made.has_value());
  const double open_frac = model == scene::ThermalModel::foster ? 1.0 : 0.5;
  return made->temperature_k(0, crossed(nodes, open_frac));
}

TEST(CliConverged, more_steps_change_nothing) {
  for (const auto model : {scene::ThermalModel::emit2014, scene::ThermalModel::foster}) {
    EXPECT_NEAR(ground_k(model, 1440), ground_k(model, 5760), 0.003);
    EXPECT_GT(std::abs(ground_k(model, 9) - ground_k(model, 5760)), 0.01);
  }
}

TEST(CliConverged, instant_surfaces_stand_at_their_equilibrium) {
  auto s = scenario(scene::ThermalModel::emit2014);
  s.materials[0].modes = {{1e-3, 1.0}};
  scene::WeatherSample weather;
  weather.direct_normal_w_m2 = 800.0;
  weather.diffuse_horizontal_w_m2 = 90.0;
  weather.longwave_down_w_m2 = 330.0;
  weather.air_k = 295.0;
  weather.cloud_frac = 0.25;
  weather.environment_k = 300.0;
  s.weather = {weather};
  const auto nodes = uniform_nodes(10);
  const auto made = ConvergedModel::create(s, s.materials, nodes);
  ASSERT_TRUE(made.has_value());
  const glm::dvec3& sun = made->sun_w_m2(10);
  EXPECT_NEAR(std::sqrt(sun.x * sun.x + sun.y * sun.y + sun.z * sun.z), 600.0, 1e-9);
  const std::vector<PointView> view(11, {{0.0, 0.0, 1.0}, 0.5, 0.4});
  const double env_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(300.0, 4);
  const double absorbed_w_m2 =
      0.6 * (0.5 * sun.z + 0.4 * 180.0) + 0.6 * 0.92 * env_w_m2 + 0.92 * 0.4 * (660.0 - env_w_m2);
  const auto expected = physics::solve_equilibrium(physics::SurfaceBalance<double>{
      0.92 * physics::kStefanBoltzmannWPerM2K4, 24.0, absorbed_w_m2 + 24.0 * 293.15});
  EXPECT_NEAR(made->temperature_k(0, view), expected.temperature_k, 1e-6);
}

/// Makes a wall, 3 m high, 2 m wide and 1 m east of the origin, on level ground.
reference::RayMesh wall_on_ground() {
  reference::RayMesh mesh;
  mesh.positions_m = {{-50.0, -50.0, 0.0}, {50.0, -50.0, 0.0}, {50.0, 50.0, 0.0},
                      {-50.0, 50.0, 0.0},  {1.0, -1.0, 0.0},   {1.0, 1.0, 0.0},
                      {1.0, 1.0, 3.0},     {1.0, -1.0, 3.0}};
  mesh.indices = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
  return mesh;
}

PixelSurface ground_point(double x_m, double y_m) {
  PixelSurface out;
  out.surface = true;
  out.position_m = {x_m, y_m, 0.0};
  out.normal = out.shading_normal = {0.0, 0.0, 1.0};
  return out;
}

TEST(CliConverged, an_outline_is_found_from_either_side) {
  // The rim turns away from an eye above it, and the ground is half a metre behind it. The way
  // there is nearly square to the rim's own normal.
  PixelSurface rim = ground_point(0.0, 0.0);
  rim.position_m = {0.0, 0.0, 0.5};
  rim.normal = rim.shading_normal = {1.0, 0.0, 0.0};
  rim.distance_m = 2.0;
  PixelSurface ground = ground_point(0.002, 0.0);
  ground.distance_m = 2.5;
  EXPECT_TRUE(is_outline(rim, ground, 1e-3));
  EXPECT_TRUE(is_outline(ground, rim, 1e-3));
  PixelSurface beside = ground_point(0.006, 0.0);
  beside.distance_m = 2.5;
  EXPECT_FALSE(is_outline(ground, beside, 1e-3));
}

TEST(CliConverged, looking_coarse_to_fine_misses_no_shadow) {
  const auto scene = reference::RayScene::create({{wall_on_ground()}, {}});
  ASSERT_TRUE(scene.has_value());
  const ConvergedViews views(*scene, 0, kEndNs, {}, {});
  const auto nodes = views.nodes_ns();
  ASSERT_EQ(nodes.size(), 1441U);
  const auto s = scenario(scene::ThermalModel::foster);
  const auto model = ConvergedModel::create(s, s.materials, nodes);
  ASSERT_TRUE(model.has_value());
  const reference::SceneInstant instant = scene->at(0);
  std::vector<PointView> seen(nodes.size());
  int partly = 0;
  for (const auto& point : {ground_point(-1.0, 0.3), ground_point(-0.5, 1.2),
                            ground_point(0.4, -0.9), ground_point(-2.0, 0.9)}) {
    views.see(point, *model, seen);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double all = instant
                             .sun_visible_frac({point.position_m, point.normal, 1e-9},
                                               glm::normalize(model->sun_w_m2(i)), {.rays = 64})
                             .value_frac;
      EXPECT_NEAR(seen[i].sun_frac, all, 0.1) << i;  // the first rays miss a sliver
      if (all > 0.0 && all < 1.0) ++partly;
    }
    EXPECT_LT(seen[0].sky_frac, 1.0);
    EXPECT_EQ(seen[0].sky_frac, seen.back().sky_frac);
  }
  EXPECT_GT(partly, 20);
}

TEST(CliConverged, steps_are_cut_finer_while_a_caster_moves) {
  reference::RayMesh body = wall_on_ground();
  body.indices.erase(body.indices.begin(), body.indices.begin() + 6);
  body.entity = 0;
  reference::RayEntity entity;
  entity.poses.resize(2);
  entity.poses[0].sim_time_ns = 3600 * kSecondNs;
  entity.poses[1].sim_time_ns = 3610 * kSecondNs;
  entity.poses[1].pose.position_world_m = {0.0, 40.0, 0.0};
  const auto scene = reference::RayScene::create({{body}, {entity}});
  ASSERT_TRUE(scene.has_value());
  const ConvergedViews views(*scene, 0, kEndNs, {}, {});
  const auto nodes = views.nodes_ns();
  EXPECT_GT(nodes.size(), 1455U);
  EXPECT_LT(nodes.size(), 1500U);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    if (nodes[i] > 3600 * kSecondNs && nodes[i] <= 3610 * kSecondNs) {
      EXPECT_LE(nodes[i] - nodes[i - 1], kSecondNs / 2);
    }
  }
  const auto s = scenario(scene::ThermalModel::foster);
  const auto model = ConvergedModel::create(s, s.materials, nodes);
  ASSERT_TRUE(model.has_value());
  std::vector<PointView> seen(nodes.size());
  views.see(ground_point(0.9, 0.0), *model, seen);
  EXPECT_LT(seen.front().sky_frac, 0.8);
  EXPECT_GT(seen.back().sky_frac, 0.99);  // the wall has gone
}

}  // namespace
}  // namespace emit::tool
