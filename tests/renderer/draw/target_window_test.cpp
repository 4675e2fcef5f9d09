// SPDX-License-Identifier: Apache-2.0
#include "draw/target_window.hpp"

#include <gtest/gtest.h>

#include <glm/ext/matrix_transform.hpp>
#include <limits>

#include "draw/camera_setup.hpp"
#include "emit/physics/frames.hpp"

namespace emit::renderer {
namespace {

constexpr glm::uvec2 kImagePx(640, 512);

/// Camera at the origin that looks north along the ground.
ViewVolume view_north() {
  scene::SensorDesc sensor;
  sensor.width_px = kImagePx.x;
  sensor.height_px = kImagePx.y;
  gpu::FrameParams params{};
  params.rendered_px = kImagePx;
  return set_camera(sensor, 0.1,
                    {glm::dvec3(0.0), physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)},
                    params)
      .view;
}

TargetWindow empty_window() {
  TargetWindow window;
  window.first_px = glm::dvec2(std::numeric_limits<double>::infinity());
  window.end_px = -window.first_px;
  return window;
}

TEST(TargetWindow, FitsAroundABox) {
  // Half a metre is 0.5 / (10 km * pixel) pixels to either side of the middle.
  const ViewVolume view = view_north();
  const scene::Aabb box{glm::dvec3(-0.5, -0.5, -0.25), glm::dvec3(0.5, 0.5, 0.25)};
  const glm::dmat4 there = glm::translate(glm::dmat4(1.0), glm::dvec3(0.0, 1e4, 0.0));
  TargetWindow window = empty_window();
  ASSERT_TRUE(add_box(window, view, there, box, kImagePx));
  const double per_px = 2.0 * view.tan_half_h / kImagePx.x;
  const double nearest_m = 1e4 - 0.5;
  EXPECT_NEAR(window.size_px().x, 1.0 / nearest_m / per_px, 1e-9);
  EXPECT_NEAR(window.size_px().y, 0.5 / nearest_m / per_px, 1e-9);
  EXPECT_NEAR(0.5 * (window.first_px.x + window.end_px.x), 320.0, 1e-9);
  EXPECT_NEAR(0.5 * (window.first_px.y + window.end_px.y), 256.0, 1e-9);
  EXPECT_NEAR(window.farthest_m, 1e4 + 0.5, 1e-9);
}

TEST(TargetWindow, HasNoBoxThatReachesBehindTheNearPlane) {
  TargetWindow window = empty_window();
  const scene::Aabb box{glm::dvec3(-1.0), glm::dvec3(1.0)};
  EXPECT_FALSE(add_box(window, view_north(), glm::dmat4(1.0), box, kImagePx));
}

TEST(TargetWindow, IsAllOfItsClipSpaceHoweverSmallItIs) {
  const ViewVolume view = view_north();
  for (const double size_px : {20.0, 0.3, 1e-5}) {
    TargetWindow window;
    window.first_px = {101.3, 417.8};
    window.end_px = window.first_px + glm::dvec2(size_px, 0.5 * size_px);
    const ViewVolume through = view_through(window, view, kImagePx);
    for (const glm::dvec2 side : {glm::dvec2(0.0, 0.0), glm::dvec2(1.0, 0.5)}) {
      // Take the ray through a corner, 20 km along.
      const glm::dvec2 px = window.first_px + size_px * side;
      const glm::dvec2 ndc = 2.0 * px / glm::dvec2(kImagePx) - 1.0;
      const glm::dvec3 ray(ndc * glm::dvec2(view.tan_half_h, view.tan_half_v), 1.0);
      const glm::dvec4 clip =
          through.clip_from_relworld * glm::dvec4(view.relworld_from_sensor * (2e4 * ray), 1.0);
      const double corner = side.x > 0.0 ? 1.0 : -1.0;
      EXPECT_NEAR(clip.x / clip.w, corner, 1e-5) << size_px;
      EXPECT_NEAR(clip.y / clip.w, corner, 1e-5) << size_px;
      EXPECT_NEAR(clip.w, 2e4, 1e-6);
    }
  }
}

TEST(TargetWindow, HasFourSamplesAlongTheSideOfAPixel) {
  for (const double size_px : {0.01, 1.0, 16.0, 16.1, scene::kMaxSmallTargetPx}) {
    EXPECT_GE(window_samples(size_px) / size_px, 4.0 * (1.0 - 1e-12)) << size_px;
  }
}

}  // namespace
}  // namespace emit::renderer
