// SPDX-License-Identifier: Apache-2.0
#include "bench/frame_time/scaling_axes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "emit/physics/frames.hpp"
#include "emit/scenegen/generate.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using physics::Result;
using Path = std::filesystem::path;

/// Limits of the ratios that the project claims: twice the steps, ten times the triangles, ten
/// times the instances.
constexpr double kStepsLimit = 1.02;
constexpr double kTrianglesLimit = 1.5;
constexpr double kObjectsLimit = 1.1;

struct Format {
  std::uint32_t width_px = 320;
  std::uint32_t height_px = 256;
};

/// Loads a shipped scene with the method "cached".
Result<scene::ScenarioDesc> cached_scene(const std::string& name, bool quick) {
  auto scenario = load_scenario_choice(
      {name,
       {"thermal.method=\"cached\"", "thermal.model=\"foster\"", "thermal.spacing=\"geometric\"",
        "thermal.steps=27", fmt::format("thermal.tolerance_k={}", quick ? 2.0 : 0.1)}});
  if (!scenario) return scenario;
  const Format format = quick ? Format{64, 48} : Format{};
  scenario->sensor.width_px = format.width_px;
  scenario->sensor.height_px = format.height_px;
  return scenario;
}

Result<Path> generated(const scenegen::GenerateOptions& options) {
  auto files = scenegen::generate(options);
  if (!files) return tl::unexpected(std::move(files.error()));
  return files->files.front().path;
}

Result<void> add_steps(ScalingAxis& axis, bool quick) {
  auto scenario = cached_scene("box", quick);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  axis.limit_ratio = kStepsLimit;
  for (const std::uint32_t steps : {27U, 54U, 108U}) {
    if (quick && steps > 54) break;
    scenario->thermal.steps = steps;
    axis.cases.push_back({static_cast<double>(steps), *scenario});
  }
  return {};
}

/// Adds the shipped figure with fewer and more triangles, seen from the same place.
Result<void> add_triangles(ScalingAxis& axis, bool quick, const Path& folder) {
  auto scenario = cached_scene("statue", quick);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  axis.limit_ratio = kTrianglesLimit;
  for (const std::uint32_t triangles : {10'000U, 100'000U, 1'000'000U, 10'000'000U}) {
    if (quick ? triangles > 100'000 : triangles < 100'000) continue;
    scenegen::GenerateOptions options;
    options.kind = scenegen::SceneKind::statue;
    options.directory = folder / fmt::format("statue-{}", triangles);
    options.statue.min_triangles = triangles;
    const auto file = generated(options);
    if (!file) return tl::unexpected(file.error());
    scenario->objects.front().gltf = *file;
    axis.cases.push_back({static_cast<double>(triangles), *scenario});
  }
  return {};
}

Result<void> add_pixels(ScalingAxis& axis, bool quick) {
  auto scenario = cached_scene("box", quick);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  const std::vector<Format> formats =
      quick ? std::vector<Format>{{64, 48}, {128, 96}}
            : std::vector<Format>{{320, 256}, {640, 512}, {1024, 768}, {1280, 1024}};
  for (const Format& format : formats) {
    scenario->sensor.width_px = format.width_px;
    scenario->sensor.height_px = format.height_px;
    axis.cases.push_back({1.0 * format.width_px * format.height_px, *scenario});
  }
  return {};
}

/// Returns places in rows behind the camera, so far apart that none shades another nor the view.
std::vector<physics::Pose> places_behind(const physics::Pose& camera, std::uint32_t count) {
  constexpr double kApartM = 10.0;
  constexpr double kBehindM = 100.0;
  const glm::dvec3 ahead = camera.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  const double length = std::hypot(ahead.x, ahead.y);
  const glm::dvec3 back(-ahead.x / length, -ahead.y / length, 0.0);
  const glm::dvec3 side(-back.y, back.x, 0.0);
  const auto row = static_cast<std::uint32_t>(std::ceil(std::sqrt(count)));
  std::vector<physics::Pose> places;
  for (std::uint32_t i = 0; i < count; ++i) {
    physics::Pose pose;
    pose.position_world_m = back * (kBehindM + kApartM * (i / row)) +
                            side * (kApartM * (i % row - 0.5 * row)) +
                            glm::dvec3(camera.position_world_m.x, camera.position_world_m.y, 0.0);
    places.push_back(pose);
  }
  return places;
}

/// Adds the same box many times behind the camera.
Result<void> add_objects(ScalingAxis& axis, bool quick, const Path& folder) {
  auto scenario = cached_scene("box", quick);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  axis.limit_ratio = kObjectsLimit;
  scenario->thermal.max_samples = 20'000'000;  // so that what is in view stays the same
  scenario->thermal.steps = 9;  // frames do not hang on it, the warm-up of many instances does
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::box;
  options.directory = folder;
  options.box = {1.0, 0.0};
  const auto file = generated(options);
  if (!file) return tl::unexpected(file.error());
  const physics::Pose camera = scenario->sensor.trajectory.front().pose;
  for (const std::uint32_t count : {10U, 100U, 1000U, 10'000U}) {
    if (quick ? count > 100 : count < 100) continue;
    ScalingCase made{static_cast<double>(count), *scenario};
    scene::ObjectDesc object;
    object.name = "behind";
    object.gltf = *file;
    object.instances = places_behind(camera, count);
    made.scenario.objects.push_back(std::move(object));
    axis.cases.push_back(std::move(made));
  }
  return {};
}

Result<void> add_samples(ScalingAxis& axis, bool quick) {
  auto scenario = cached_scene("box", quick);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  const std::vector<double> tolerances_k =
      quick ? std::vector<double>{4.0, 1.0} : std::vector<double>{0.4, 0.1, 0.025};
  for (const double tolerance_k : tolerances_k) {
    scenario->thermal.tolerance_k = tolerance_k;
    axis.cases.push_back({0.0, *scenario});
  }
  return {};
}

}  // namespace

std::vector<std::string> scaling_axes() {
  return {"steps", "triangles", "pixels", "objects", "samples"};
}

Result<ScalingAxis> make_scaling_axis(const std::string& name, bool quick, const Path& folder) {
  ScalingAxis axis;
  axis.name = name;
  Result<void> made;
  if (name == "steps") made = add_steps(axis, quick);
  if (name == "triangles") made = add_triangles(axis, quick, folder);
  if (name == "pixels") made = add_pixels(axis, quick);
  if (name == "objects") made = add_objects(axis, quick, folder);
  if (name == "samples") made = add_samples(axis, quick);
  if (!made) return tl::unexpected(std::move(made.error()));
  return axis;
}

}  // namespace emit::tool
