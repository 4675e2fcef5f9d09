// SPDX-License-Identifier: Apache-2.0
// Feet of bodies on the ground: the method cached against conduction in three dimensions.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/mesh.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

constexpr std::uint32_t kWidth = 96;
constexpr std::uint32_t kHeight = 72;
constexpr std::int64_t kSolvedNs = 2 * 3600 * kSecondNs;

/// A body of one material that stands on a road, and the box around it.
struct Footed {
  std::string name;
  std::vector<Quad> faces;
  glm::dvec3 low_m{0.0};
  glm::dvec3 high_m{0.0};
  double layer_m = 0.0;
};

Quad turned_over(const Quad& quad) {
  return {quad.d, quad.c, quad.b, quad.a};
}
Quad level(double west_m, double south_m, double east_m, double north_m) {
  return {{west_m, south_m, 0.0},
          {east_m, south_m, 0.0},
          {east_m, north_m, 0.0},
          {west_m, north_m, 0.0}};
}
Footed solid(const std::string& name, const glm::dvec3& size_m, double layer_m) {
  Footed out{name, {}, {-0.5 * size_m.x, -0.5 * size_m.y, 0.0}, {}, layer_m};
  out.high_m = out.low_m + size_m;
  out.faces = box(out.low_m, out.high_m);
  out.faces.push_back(turned_over(level(out.low_m.x, out.low_m.y, out.high_m.x, out.high_m.y)));
  return out;
}
/// Adds a closed cavity that is open to the ground alone.
Footed hollow(Footed body, double wall_m) {
  const glm::dvec3 low_m = body.low_m + glm::dvec3(wall_m, wall_m, 0.0);
  const glm::dvec3 high_m = body.high_m - glm::dvec3(wall_m);
  body.faces.pop_back();
  for (const Quad& face : box(low_m, high_m)) body.faces.push_back(turned_over(face));
  for (const Quad& ring : {level(body.low_m.x, body.low_m.y, low_m.x, body.high_m.y),
                           level(high_m.x, body.low_m.y, body.high_m.x, body.high_m.y),
                           level(low_m.x, body.low_m.y, high_m.x, low_m.y),
                           level(low_m.x, high_m.y, high_m.x, body.high_m.y)}) {
    body.faces.push_back(turned_over(ring));
  }
  return body;
}

scene::ScenarioDesc on_road(const Footed& body) {
  scene::ScenarioDesc scenario = instant_scenario(write_quads("road", {ground(3.0, 3.0)}));
  scene::Material& road = scenario.materials[0];
  road.name = "asphalt";
  road.layers = {{0.15, 0.7, 2120.0, 920.0}, {0.35, 1.5, 2000.0, 950.0}};
  road.solar_absorptance_frac = 0.75;
  road.base_k = 293.15;
  road.modes.clear();
  scene::Material concrete = road;
  concrete.name = "concrete";
  concrete.layers = {{body.layer_m, 1.28, 2300.0, 878.0}};
  concrete.solar_absorptance_frac = 0.6;
  scenario.materials.push_back(concrete);
  scenario.default_material = "asphalt";
  scenario.objects[0].name = "road";
  scenario.objects[0].material = "asphalt";
  scene::ObjectDesc block = scenario.objects[0];
  block.name = body.name;
  block.material = "concrete";
  block.gltf = write_quads(body.name, body.faces);
  scenario.objects.push_back(block);
  scenario.weather[0].film_w_m2_k = 12.0;
  scenario.thermal.method = scene::ThermalMethod::cached;
  scenario.thermal.model = scene::ThermalModel::foster;
  scenario.thermal.initial_k = 293.15;
  scenario.thermal.spin_up_ns = 0;
  scenario.thermal.history_start_ns = 0;
  scenario.thermal.steps = 27;
  scenario.thermal.spacing = scene::StepSpacing::geometric;
  scenario.sensor.width_px = kWidth;
  scenario.sensor.height_px = kHeight;
  scenario.sensor.fov_h_rad = 30.0 * physics::kDegree;
  return scenario;
}

/// Root mean squares of the errors of the pixels of one part of the picture.
struct Errors {
  double squares = 0.0;
  std::size_t count = 0;
  void add(double off_k) {
    squares += off_k * off_k;
    ++count;
  }
  [[nodiscard]] double rms_k() const { return std::sqrt(squares / static_cast<double>(count)); }
};

TEST(RendererFeet, RoadAndWallsAtTheFeetOfBodiesAreAsInThreeDimensions) {
  const std::array<Footed, 3> bodies{solid("block", {0.5, 0.3, 0.25}, 0.1),
                                     hollow(solid("shell", {0.4, 0.5, 0.3}, 0.05), 0.05),
                                     solid("wall", {0.8, 0.2, 0.4}, 0.05)};
  const glm::dvec3 eye_m{-1.1, -1.3, 0.9};
  const physics::Pose pose{eye_m, physics::world_from_body_look_at(eye_m, {-0.1, 0.0, 0.05})};
  for (const Footed& body : bodies) {
    SCOPED_TRACE(body.name);
    const scene::ScenarioDesc scenario = on_road(body);
    const auto geometry = scene::load_scene(scenario);
    ASSERT_TRUE(geometry.has_value()) << geometry.error().text;
    reference::SolveOptions options;
    options.dimension = reference::SolveDimension::three;
    options.refine = 0.3;
    options.rays = 64;
    const reference::SolveView view{kSolvedNs, pose, kWidth, kHeight, scenario.sensor.fov_h_rad};
    const auto truth = reference::solve(scenario, *geometry, std::span(&view, 1), options);
    ASSERT_TRUE(truth.has_value()) << truth.error().text;
    renderer::OutputOptions output;
    output.temperature = true;
    output.depth = true;
    auto renderer = renderer::Renderer::create(scenario, {}, output);
    ASSERT_TRUE(renderer.has_value()) << renderer.error().text;
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = kSolvedNs;
    request.sensor_pose = pose;
    const auto slot = static_cast<renderer::SlotIndex>((*renderer)->submit(request));
    const auto& frame = (*renderer)->collect(slot);
    ASSERT_FALSE(frame.device_failed);
    Errors at_foot;
    Errors near_foot;
    Errors low_on_wall;
    Errors rest;
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        const std::size_t i = y * kWidth + x;
        const double off_k = static_cast<double>(frame.temperature_k[i]) -
                             static_cast<double>((*truth)[0].temperature_k[i]);
        // Leave out pixels in which one of both pictures shows another face, and the sky.
        const double apart_m = std::abs(frame.depth_m[i] - (*truth)[0].depth_m[i]);
        if (std::isnan(off_k) || !(apart_m < 2e-3)) continue;
        const glm::dvec3 at_m = world_point(scenario.sensor, pose, x, y, frame.depth_m[i]);
        const glm::dvec3 past_m =
            glm::max(glm::max(body.low_m - at_m, at_m - body.high_m), glm::dvec3(0.0));
        const double away_m = std::hypot(past_m.x, past_m.y);
        constexpr double kRoundingM = 2e-3;
        if (at_m.z > kRoundingM) {
          (at_m.z < 0.05 ? low_on_wall : rest).add(off_k);
        } else if (away_m > kRoundingM && away_m < 0.2) {
          (away_m < 0.02 ? at_foot : near_foot).add(off_k);
        }
      }
    }
    (*renderer)->release(slot);
    const auto judge = [&](const char* part, const Errors& errors, std::size_t least,
                           double bar_k) {
      ASSERT_GT(errors.count, least) << part;
      RecordProperty(body.name + "_" + part + "_rms_k", std::to_string(errors.rms_k()));
      EXPECT_LT(errors.rms_k(), bar_k) << part;
    };
    judge("at_foot", at_foot, 20, 0.8);
    judge("near_foot", near_foot, 300, 0.4);
    judge("low_on_wall", low_on_wall, 50, 0.65);
    judge("rest", rest, 200, 0.3);
  }
}

}  // namespace
}  // namespace emit::test
