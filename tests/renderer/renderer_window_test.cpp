// SPDX-License-Identifier: Apache-2.0
// Windows of an image: their pixels have the bits of the whole image, and nothing else is drawn.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/renderer/renderer.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

constexpr std::int64_t kNowNs = 3 * 3'600'000'000'000;
constexpr std::uint32_t kWidthPx = 130;  // not a multiple of the size of any work group
constexpr std::uint32_t kHeightPx = 97;

physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}
const physics::Pose kHere = looking({-7.0, 9.0, 9.0}, {0.0, 0.0, 0.5});
const physics::Pose kElsewhere = looking({6.0, 5.0, 7.0}, {0.0, 0.0, 0.5});

/// Scenario with a box on the ground. Its shadow, its outline and the obscurance at its foot cross
/// every window.
scene::ScenarioDesc box_on_ground() {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(30.0, 30.0));
  scene::ScenarioDesc s = instant_scenario(write_quads("box", quads));
  s.sensor.width_px = kWidthPx;
  s.sensor.height_px = kHeightPx;
  s.thermal.steps = 9;
  s.sensor.trajectory = {{kNowNs, kHere, true}, {kNowNs + 1'000'000'000, kElsewhere, true}};
  return s;
}

/// Windows of different sizes and positions.
const std::vector<scene::PixelRect>& windows() {
  static const std::vector<scene::PixelRect> all = {
      {41, 29, 37, 31}, {0, 0, 64, 48}, {65, 48, 65, 49}, {0, 40, kWidthPx, 9}, {64, 50, 1, 1}};
  return all;
}

/// Renderer that is warmed up for both poses.
class Camera {
 public:
  explicit Camera(const scene::ScenarioDesc& scenario, renderer::Ladder ladder) {
    renderer::OutputOptions output;
    output.temperature = true;
    output.ladder = ladder;
    auto made = renderer::Renderer::create(scenario, {}, output);
    EXPECT_TRUE(made.has_value()) << made.error().text;
    renderer_ = std::move(*made);
    renderer::FrameRequest first;
    first.sim_time_ns = first.thermal_time_ns = kNowNs;
    first.sensor_pose = kHere;
    EXPECT_TRUE(renderer_->warm_up(first).has_value());
  }
  struct Planes {
    std::vector<float> radiance;
    std::vector<float> temperature;
  };
  [[nodiscard]] Planes render(const physics::Pose& pose, std::uint8_t quality_level = 0,
                              const scene::PixelRect& window_px = {}, double fov_h_rad = 0.0) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = kNowNs;
    request.sensor_pose = pose;
    request.quality_level = quality_level;
    request.window_px = window_px;
    request.fov_h_rad = fov_h_rad;
    const auto slot = static_cast<renderer::SlotIndex>(renderer_->submit(request));
    const auto& view = renderer_->collect(slot);
    EXPECT_FALSE(view.device_failed);
    coarse_ = view.stats.coarse.any();
    const auto plane = view.radiance_w_m2_sr[0];
    Planes out{{plane.begin(), plane.end()},
               {view.temperature_k.begin(), view.temperature_k.end()}};
    renderer_->release(slot);
    return out;
  }

  /// Returns whether the frame rendered last was coarse.
  [[nodiscard]] bool coarse() const { return coarse_; }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
  bool coarse_ = false;
};

/// Number of pixels of `window` whose bits differ between two images.
std::size_t differing(const std::vector<float>& a, const std::vector<float>& b,
                      const scene::PixelRect& window) {
  std::size_t count = 0;
  for (std::uint32_t y = window.y_px; y < window.y_px + window.height_px; ++y) {
    for (std::uint32_t x = window.x_px; x < window.x_px + window.width_px; ++x) {
      const std::size_t at = std::size_t{y} * kWidthPx + x;
      count += std::memcmp(&a[at], &b[at], sizeof(float)) != 0 ? 1U : 0U;
    }
  }
  return count;
}

/// Expects the bits of the whole image in every window, at the given quality levels.
void expect_windows_of(const scene::ScenarioDesc& scenario, renderer::Ladder ladder,
                       const std::vector<std::uint8_t>& quality_levels) {
  Camera camera(scenario, ladder);
  for (const std::uint8_t quality_level : quality_levels) {
    const auto whole = camera.render(kHere, quality_level);
    for (const scene::PixelRect& window : windows()) {
      // Fill the memory with another frame, which must not show through.
      const auto before = camera.render(kElsewhere, quality_level);
      ASSERT_GT(differing(whole.radiance, before.radiance, {0, 0, kWidthPx, kHeightPx}), 3000U);
      const auto part = camera.render(kHere, quality_level, window);
      EXPECT_EQ(differing(whole.radiance, part.radiance, window), 0U)
          << "quality_level " << int{quality_level} << ", window at " << window.x_px << ", "
          << window.y_px;
      EXPECT_EQ(differing(whole.temperature, part.temperature, window), 0U)
          << "quality_level " << int{quality_level} << ", window at " << window.x_px << ", "
          << window.y_px;
    }
    EXPECT_EQ(differing(whole.radiance, camera.render(kHere, quality_level).radiance,
                        {0, 0, kWidthPx, kHeightPx}),
              0U)
        << "a window leaves no trace";
  }
}

TEST(RendererFieldOfView, AFrameHasTheBitsOfASensorWithThatFieldOfView) {
  auto scenario = box_on_ground();
  const double wide_rad = scenario.sensor.fov_h_rad;
  scenario.sensor.fov_h_min_rad = 0.25 * wide_rad;
  const std::vector<double> fracs = {0.25, 0.6, 1.0};
  std::vector<Camera::Planes> zoomed;
  {
    // A thread has one context at a time, so that this camera ends before the next begins.
    Camera zooming(scenario, renderer::Ladder::none);
    for (const double frac : fracs) {
      zoomed.push_back(zooming.render(kHere, 0, {}, frac * wide_rad));
      EXPECT_FALSE(zooming.coarse()) << frac;
    }
    for (const double frac : {0.24, 1.01}) {
      static_cast<void>(zooming.render(kHere, 0, {}, frac * wide_rad));
      EXPECT_TRUE(zooming.coarse()) << frac;
    }
  }
  const scene::PixelRect whole{0, 0, kWidthPx, kHeightPx};
  for (std::size_t i = 0; i < fracs.size(); ++i) {
    auto other = box_on_ground();
    other.sensor.fov_h_rad = fracs[i] * wide_rad;
    Camera fixed(other, renderer::Ladder::none);
    EXPECT_EQ(differing(fixed.render(kHere).radiance, zoomed[i].radiance, whole), 0U) << fracs[i];
    if (i > 0) {
      EXPECT_GT(differing(zoomed[0].radiance, zoomed[i].radiance, whole), 3000U) << fracs[i];
    }
  }
}

TEST(RendererWindow, HoldsTheBitsOfTheWholePicture) {
  expect_windows_of(box_on_ground(), renderer::Ladder::none, {0});
}

TEST(RendererWindow, HoldsTheBitsOfTheWholePictureWithFoster) {
  auto scenario = box_on_ground();
  scenario.thermal.model = scene::ThermalModel::foster;
  scenario.thermal.steps = 5;
  expect_windows_of(scenario, renderer::Ladder::none, {0});
}

TEST(RendererWindow, HoldsTheBitsOfTheWholePictureOnEveryQualityLevelOfCachedFrames) {
  auto scenario = box_on_ground();
  scenario.weather.clear();
  scenario.thermal.method = scene::ThermalMethod::cached;
  expect_windows_of(scenario, renderer::Ladder::replayed, {0, 2, 5, 7, 9, 10});
}

TEST(RendererWindow, NothingElseIsDrawn) {
  for (const bool cached : {false, true}) {
    auto scenario = box_on_ground();
    if (cached) {
      scenario.weather.clear();
      scenario.thermal.method = scene::ThermalMethod::cached;
    }
    Camera camera(scenario, renderer::Ladder::none);
    const auto whole = camera.render(kHere);
    for (int slot = 0; slot < 3; ++slot) (void)camera.render(kElsewhere);
    const scene::PixelRect window{41, 29, 37, 31};
    const auto elsewhere = camera.render(kElsewhere);
    const auto part = camera.render(kHere, 0, window);
    // Expect that only the window's rows of the slot were written, and in them only its columns
    // were drawn.
    const scene::PixelRect above{0, 0, kWidthPx, 29};
    const scene::PixelRect right{78, 29, kWidthPx - 78, 31};
    EXPECT_EQ(differing(part.radiance, elsewhere.radiance, above), 0U);
    EXPECT_EQ(differing(part.radiance, elsewhere.radiance, right), 0U);
    EXPECT_GT(differing(part.radiance, whole.radiance, right), 0U);
  }
}

TEST(RendererWindow, OneThatDoesNotFitIsTheWholePicture) {
  Camera camera(box_on_ground(), renderer::Ladder::none);
  const auto whole = camera.render(kHere);
  for (const scene::PixelRect& window :
       {scene::PixelRect{100, 0, 31, 1}, scene::PixelRect{0, 96, 1, 2},
        scene::PixelRect{4294967295U, 0, 2, 1}, scene::PixelRect{3, 3, 0, 5}}) {
    (void)camera.render(kElsewhere);
    EXPECT_EQ(differing(camera.render(kHere, 0, window).radiance, whole.radiance,
                        {0, 0, kWidthPx, kHeightPx}),
              0U);
  }
}

}  // namespace
}  // namespace emit::test
