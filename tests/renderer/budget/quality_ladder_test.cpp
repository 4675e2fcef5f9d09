// SPDX-License-Identifier: Apache-2.0
// Frames of lower quality levels are whole images, close to full quality, as far off as they state,
// and leave no trace in the frames that follow.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kStartNs = 3600 * kSecondNs;
constexpr std::uint8_t kQualityLevels = 12;
constexpr std::size_t kMovedPx = 4;
/// Instants around the judged one. The estimate comes from a view near by, in which another number
/// of pixels along edges changes sides, so that it must lie among the differences of such views.
constexpr std::array<double, 4> kAroundS = {-1.2, -0.6, 0.6, 1.2};

physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}

/// Scenario with a box on the ground that the camera approaches for ten seconds.
scene::ScenarioDesc approach() {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(120.0, 120.0));
  scene::ScenarioDesc s = instant_scenario(write_quads("box", quads));
  s.weather.clear();
  s.sensor.width_px = 130;  // not a multiple of the size of any work group
  s.sensor.height_px = 97;
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.steps = 9;
  s.sensor.trajectory = {
      {kStartNs, looking({4.0, -20.0, 9.0}, {0.0, 0.0, 0.5}), true},
      {kStartNs + 10 * kSecondNs, looking({2.0, -8.0, 5.0}, {0.0, 0.0, 0.5}), true}};
  return s;
}

struct Frame {
  std::vector<float> radiance_w_m2_sr;
  std::vector<float> temperature_k;
  std::uint8_t quality_level = 0;
  float estimated_error_k = 0.0F;
};

/// Renderer of the approach, warmed up for its start.
class Flight {
 public:
  explicit Flight(const scene::ScenarioDesc& scenario, renderer::Ladder ladder) {
    renderer::OutputOptions output;
    output.temperature = true;
    output.ladder = ladder;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (!made) {
      ADD_FAILURE() << made.error().text;
      return;
    }
    renderer_ = std::move(*made);
    const auto ready = renderer_->warm_up(request(0.0, 0));
    EXPECT_TRUE(ready.has_value());
  }
  [[nodiscard]] renderer::FrameRequest request(double seconds, std::uint8_t quality_level) const {
    renderer::FrameRequest request;
    request.sim_time_ns = kStartNs + std::llround(seconds * 1e9);
    request.thermal_time_ns = kStartNs;
    request.sensor_pose = renderer_->scenario_sensor_pose_at(request.sim_time_ns);
    request.quality_level = quality_level;
    return request;
  }
  [[nodiscard]] Frame frame(const renderer::FrameRequest& request) {
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    const auto plane = view.radiance_w_m2_sr[0];
    Frame out{{plane.begin(), plane.end()},
              {view.temperature_k.begin(), view.temperature_k.end()},
              view.quality_level,
              view.estimated_error_k};
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }
  [[nodiscard]] renderer::Renderer& renderer() { return *renderer_; }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
};

double rms_k(const scene::ScenarioDesc& scenario, const Frame& a, const Frame& b) {
  const physics::ApparentTemperature apparent(
      physics::Band{scenario.bands[0].lo_um, scenario.bands[0].hi_um, {}});
  return apparent.rms_difference_k(a.radiance_w_m2_sr, b.radiance_w_m2_sr);
}

TEST(RendererLadder, QualityLevelsAreWholePicturesAndAsFarOffAsTheySay) {
  const auto scenario = approach();
  Flight run(scenario, renderer::Ladder::live);
  for (const double seconds : {0.0, 2.3, 7.9}) {
    const Frame full = run.frame(run.request(seconds, 0));
    EXPECT_EQ(full.estimated_error_k, 0.0F);
    double scaled_k = 0.0;
    for (std::uint8_t quality_level = 1; quality_level < kQualityLevels; ++quality_level) {
      const Frame shed = run.frame(run.request(seconds, quality_level));
      EXPECT_EQ(shed.quality_level, quality_level);
      const double difference_k = rms_k(scenario, full, shed);
      // Expect errors along edges only: the image shifted by a pixel of the coarsest level is
      // worse.
      Frame moved = shed;
      for (std::size_t i = 0; i + kMovedPx < moved.radiance_w_m2_sr.size(); ++i) {
        moved.radiance_w_m2_sr[i] = shed.radiance_w_m2_sr[i + kMovedPx];
      }
      EXPECT_LT(difference_k, 0.9 * rms_k(scenario, full, moved))
          << seconds << " s, quality_level " << int{quality_level};
      const auto estimate_k = static_cast<double>(shed.estimated_error_k);
      double least_k = difference_k;
      double most_k = difference_k;
      for (const double around_s : kAroundS) {
        const double at_s = std::max(0.0, seconds + around_s);
        const double near_k = rms_k(scenario, run.frame(run.request(at_s, 0)),
                                    run.frame(run.request(at_s, quality_level)));
        least_k = std::min(least_k, near_k);
        most_k = std::max(most_k, near_k);
      }
      EXPECT_LE(estimate_k, 2.0 * most_k + 0.03)
          << seconds << " s, quality_level " << int{quality_level};
      EXPECT_GE(estimate_k, 0.5 * least_k - 0.03)
          << seconds << " s, quality_level " << int{quality_level};
      scaled_k = difference_k;
    }
    EXPECT_GT(scaled_k, 0.1);  // the last level renders a sixteenth of the pixels
  }
}

TEST(RendererLadder, ShedFramesLeaveNoTrace) {
  const auto scenario = approach();
  Flight run(scenario, renderer::Ladder::live);
  const Frame before = run.frame(run.request(4.0, 0));
  const Frame shed = run.frame(run.request(4.0, kQualityLevels - 1));
  EXPECT_NE(before.radiance_w_m2_sr, shed.radiance_w_m2_sr);
  const Frame after = run.frame(run.request(4.0, 0));
  EXPECT_EQ(before.radiance_w_m2_sr, after.radiance_w_m2_sr);
  // Expect the same images from a renderer that has measured nothing, as in a replay.
  Flight replay(scenario, renderer::Ladder::replayed);
  EXPECT_EQ(replay.frame(replay.request(4.0, kQualityLevels - 1)).radiance_w_m2_sr,
            shed.radiance_w_m2_sr);
  EXPECT_EQ(replay.frame(replay.request(4.0, 0)).radiance_w_m2_sr, before.radiance_w_m2_sr);
}

TEST(RendererLadder, TemperatureIsNeverBetweenTwoObjects) {
  const auto scenario = approach();
  Flight run(scenario, renderer::Ladder::live);
  const Frame full = run.frame(run.request(4.0, 0));
  const Frame shed = run.frame(run.request(4.0, kQualityLevels - 1));
  const auto [low, high] = std::ranges::minmax(full.temperature_k);
  for (const float t : shed.temperature_k) {
    if (std::isnan(t)) continue;
    EXPECT_GE(t, low - 0.5F);
    EXPECT_LE(t, high + 0.5F);
  }
}

TEST(RendererLadder, WhatIsNotMeasuredIsNotClaimed) {
  const auto scenario = approach();
  Flight run(scenario, renderer::Ladder::live);
  auto request = run.request(4.0, 3);
  request.sensor_pose = looking({300.0, 0.0, 9.0}, {0.0, 0.0, 0.5});
  EXPECT_TRUE(std::isnan(run.frame(request).estimated_error_k));
  request = run.request(4.0, 3);
  request.sensor_pose = looking(request.sensor_pose.position_world_m, {30.0, 0.0, 0.5});
  EXPECT_TRUE(std::isnan(run.frame(request).estimated_error_k));
  const auto quality_levels = run.renderer().expected_levels(request);
  ASSERT_EQ(quality_levels.size(), std::size_t{kQualityLevels});
  EXPECT_EQ(quality_levels[0].error_k, 0.0);
  for (const renderer::QualityLevelStats& quality_level : quality_levels)
    EXPECT_GT(quality_level.frame_ms, 0.0);
}

TEST(RendererLadder, WithoutLadderThereIsFullQualityOnly) {
  auto scenario = approach();
  for (const auto method : {scene::ThermalMethod::cached, scene::ThermalMethod::per_frame}) {
    scenario.thermal.method = method;
    const bool none = method == scene::ThermalMethod::cached;
    Flight run(scenario, none ? renderer::Ladder::none : renderer::Ladder::live);
    EXPECT_EQ(run.renderer().expected_levels({}).size(), 1U);
    const Frame asked = run.frame(run.request(1.0, 9));
    EXPECT_EQ(asked.quality_level, 0);
    EXPECT_EQ(asked.estimated_error_k, 0.0F);
    EXPECT_EQ(asked.radiance_w_m2_sr, run.frame(run.request(1.0, 0)).radiance_w_m2_sr);
  }
}

}  // namespace
}  // namespace emit::test
