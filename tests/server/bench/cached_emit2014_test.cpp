// SPDX-License-Identifier: Apache-2.0
// The published model on samples of the surface (thermal.method "cached" with emit2014): against
// the per-frame method on open ground, and against the converged history of the same model.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "bench/accuracy/converged_history.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kHourNs = 3600 * kSecondNs;
constexpr std::uint32_t kWidth = 72;
constexpr std::uint32_t kHeight = 60;

physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}

/// Scenario of a clear summer day with surfaces of one fast and one slow mode.
scene::ScenarioDesc published_scenario(const std::filesystem::path& gltf) {
  scene::ScenarioDesc s = instant_scenario(gltf);
  s.weather.clear();
  s.materials[0].modes = {{300.0, 0.5}, {5000.0, 0.5}};
  s.materials[0].initial_k = 291.0;
  s.sensor.width_px = kWidth;
  s.sensor.height_px = kHeight;
  s.thermal.model = scene::ThermalModel::emit2014;
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.steps = 27;
  s.thermal.spacing = scene::StepSpacing::geometric;
  return s;
}

/// Renders frames at these instants in one run, and returns the last one's temperatures.
std::vector<float> last_frame_k(const scene::ScenarioDesc& scenario, const physics::Pose& pose,
                                const std::vector<std::int64_t>& times_ns) {
  renderer::OutputOptions output;
  output.temperature = true;
  auto renderer = renderer::Renderer::create(scenario, {}, output);
  if (!renderer) {
    ADD_FAILURE() << renderer.error().text;
    return {};
  }
  std::vector<float> out;
  for (const std::int64_t t : times_ns) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = t;
    request.sensor_pose = pose;
    const auto slot = static_cast<renderer::SlotIndex>((*renderer)->submit(request));
    const auto& view = (*renderer)->collect(slot);
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    out.assign(view.temperature_k.begin(), view.temperature_k.end());
    (*renderer)->release(slot);
  }
  return out;
}

struct Errors {
  double p90_k = 1e9;
  double p99_k = 1e9;
};
using Picture = std::vector<tool::ConvergedPixel>;

/// Returns the picture of the same model with 360 steps and traced rays. The steps of the scenario
/// have no part in it.
Picture converged_picture(const scene::ScenarioDesc& scenario, const physics::Pose& pose,
                          std::int64_t time_ns) {
  const auto converged = tool::ConvergedHistory::create(scenario);
  EXPECT_TRUE(converged.has_value());
  tool::ConvergedOptions options;
  options.steps = 360;
  options.pixels = 2400;  // of 4320, spread evenly
  const auto picture =
      converged->picture({time_ns, pose, kWidth, kHeight, scenario.sensor.fov_h_rad}, options);
  EXPECT_TRUE(picture.has_value());
  return *picture;
}

/// Compares the last frame with a converged picture, away from outlines.
Errors errors_against(const Picture& picture, const scene::ScenarioDesc& scenario,
                      const physics::Pose& pose, const std::vector<std::int64_t>& times_ns) {
  const auto shown = last_frame_k(scenario, pose, times_ns);
  std::vector<double> errors;
  for (const tool::ConvergedPixel& pixel : picture) {
    if (pixel.outline) continue;
    errors.push_back(std::abs(static_cast<double>(shown[pixel.pixel]) -
                              static_cast<double>(pixel.temperature_k)));
  }
  EXPECT_GT(errors.size(), 2000U);
  std::ranges::sort(errors);
  return {errors[errors.size() * 90 / 100], errors[errors.size() * 99 / 100]};
}

Errors errors_of(const scene::ScenarioDesc& scenario, const physics::Pose& pose,
                 const std::vector<std::int64_t>& times_ns) {
  return errors_against(converged_picture(scenario, pose, times_ns.back()), scenario, pose,
                        times_ns);
}

scene::ScenarioDesc box_on_ground() {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(12.0, 12.0));
  return published_scenario(write_quads("box", quads));
}

TEST(RendererCachedEmit2014, OpenGroundIsThatOfThePerFrameMethod) {
  auto scenario = published_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  const std::vector<std::int64_t> times_ns{2 * kHourNs, 2 * kHourNs + 7 * kSecondNs,
                                           2 * kHourNs + 300 * kSecondNs};
  for (std::size_t count = 1; count <= times_ns.size(); ++count) {
    const std::vector<std::int64_t> until(times_ns.begin(),
                                          times_ns.begin() + static_cast<std::ptrdiff_t>(count));
    scenario.thermal.method = scene::ThermalMethod::cached;
    const auto cached = last_frame_k(scenario, pose, until);
    scenario.thermal.method = scene::ThermalMethod::per_frame;
    const auto per_frame = last_frame_k(scenario, pose, {until.back()});
    ASSERT_EQ(cached.size(), per_frame.size());
    for (std::size_t i = 0; i < cached.size(); ++i) ASSERT_NEAR(cached[i], per_frame[i], 0.05) << i;
    EXPECT_GT(cached.front(), 295.0F);  // it has warmed up
  }
}

TEST(RendererCachedEmit2014, ShadeAndWallsFollowTheConvergedModel) {
  const auto scenario = box_on_ground();
  const Errors errors =
      errors_of(scenario, looking({-7.0, 9.0, 8.0}, {0.0, 0.0, 0.5}), {3 * kHourNs});
  EXPECT_LT(errors.p90_k, 0.06);
  EXPECT_LT(errors.p99_k, 0.4);
}

TEST(RendererCachedEmit2014, MoreStepsComeCloserToTheConvergedModel) {
  auto scenario = box_on_ground();
  scenario.thermal.spacing = scene::StepSpacing::uniform;
  const auto pose = looking({-7.0, 9.0, 8.0}, {0.0, 0.0, 0.5});
  const Picture converged = converged_picture(scenario, pose, 3 * kHourNs);
  scenario.thermal.steps = 9;
  const Errors coarse = errors_against(converged, scenario, pose, {3 * kHourNs});
  scenario.thermal.steps = 108;
  const Errors fine = errors_against(converged, scenario, pose, {3 * kHourNs});
  EXPECT_LT(fine.p90_k, 0.6 * coarse.p90_k);
  EXPECT_LT(fine.p99_k, 0.5 * coarse.p99_k);
}

TEST(RendererCachedEmit2014, AVehicleThatLeftLeavesItsPrint) {
  scene::ScenarioDesc scenario = published_scenario(write_quads("lot", {ground(14.0, 14.0)}));
  const std::int64_t leaves_ns = 3 * kHourNs;
  park_vehicle(scenario, leaves_ns);
  const auto pose = looking({0.0, 0.1, 16.0}, {0.0, 0.0, 0.0});
  const std::vector<std::int64_t> times_ns{leaves_ns + 60 * kSecondNs};
  const auto frame = last_frame_k(scenario, pose, times_ns);
  ASSERT_FALSE(frame.empty());
  EXPECT_LT(frame[kHeight / 2 * kWidth + kWidth / 2], frame[2 * kWidth + 2] - 5.0F);
  const Errors errors = errors_of(scenario, pose, times_ns);
  EXPECT_LT(errors.p90_k, 0.15);
  EXPECT_LT(errors.p99_k, 2.0);
}

}  // namespace
}  // namespace emit::test
