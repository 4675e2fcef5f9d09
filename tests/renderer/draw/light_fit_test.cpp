// SPDX-License-Identifier: Apache-2.0
// Light frusta hold all that the camera sees and the entities that shade it, tightly.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <random>

#include "draw/light_fit.hpp"

namespace emit::renderer {
namespace {

/// View over a wide ground.
ViewVolume view_at_ground() {
  ViewVolume view;
  // Look north and down by 30 degrees: x is east, z is along the boresight.
  const glm::dvec3 right{1.0, 0.0, 0.0};
  const glm::dvec3 forward{0.0, std::cos(0.5236), -std::sin(0.5236)};
  view.relworld_from_sensor = glm::dmat3(right, glm::cross(forward, right), forward);
  view.tan_half_h = 0.3;
  view.tan_half_v = 0.2;
  view.far_m = 2000.0;
  view.scene_min_m = {-500.0, -500.0, -60.0};
  view.scene_max_m = {500.0, 500.0, -40.0};
  // Let an entity stand higher than everything that is in the scene now.
  view.casters_min_m = {-5.0, -5.0, -60.0};
  view.casters_max_m = {5.0, 5.0, -20.0};
  return view;
}

/// Coordinates of a point in a light frustum, m.
glm::dvec3 light_coordinates(const LightFrustum& frustum, const glm::dvec3& p) {
  return glm::dvec3(glm::dot(frustum.axes[0], p), glm::dot(frustum.axes[1], p),
                    glm::dot(frustum.axes[2], p)) +
         frustum.offset_m;
}

TEST(LightFit, holds_every_visible_point_and_every_caster_in_front_of_it) {
  const ViewVolume view = view_at_ground();
  const glm::dvec3 to_sun = glm::normalize(glm::dvec3(0.5, -0.6, 0.7));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const std::uint32_t cascades : {1U, 4U}) {
    const LightFrusta frusta = fit_light(view, to_sun, 1024, cascades, 1.0, 6e-4);
    ASSERT_GE(frusta.count, 1U);
    int inside_box = 0;
    for (int i = 0; i < 20000; ++i) {
      const double depth_m = 50.0 + 100.0 * std::abs(unit(random));
      const glm::dvec3 p = view.relworld_from_sensor *
                           (glm::dvec3(unit(random) * 0.3, unit(random) * 0.2, 1.0) * depth_m);
      if (p.z < -60.0 || p.z > -40.0) continue;
      ++inside_box;
      std::uint32_t c = 0;
      while (c + 1 < frusta.count && depth_m > frusta.cascades[c].end_boresight_m) ++c;
      const glm::dvec3 at = light_coordinates(frusta.cascades[c], p);
      for (glm::length_t axis = 0; axis < 3; ++axis) {
        ASSERT_GE(at[axis], -1e-6);
        ASSERT_LE(at[axis], frusta.cascades[c].extent_m[axis] + 1e-6);
      }
      // Expect that an entity in the box, towards the sun, is nearer to the light and not cut off.
      const glm::dvec3 caster = p + to_sun * ((-20.0 - p.z) / to_sun.z);
      ASSERT_GE(light_coordinates(frusta.cascades[c], caster).z, -1e-6);
    }
    EXPECT_GT(inside_box, 1000);
  }
}

TEST(LightFit, is_tight_around_a_small_view_of_a_large_scene) {
  const ViewVolume view = view_at_ground();
  const LightFrusta frusta =
      fit_light(view, glm::normalize(glm::dvec3(0.3, 0.2, 0.9)), 1024, 1, 0.5, 6e-4);
  ASSERT_EQ(frusta.count, 1U);
  EXPECT_LT(frusta.cascades[0].extent_m.x, 250.0);  // the scene is 1000 m wide
  EXPECT_LT(frusta.cascades[0].extent_m.y, 250.0);
}

TEST(LightFit, splits_only_when_texels_would_be_coarser_than_pixels) {
  ViewVolume view = view_at_ground();
  const glm::dvec3 to_sun = glm::normalize(glm::dvec3(0.3, 0.2, 0.9));
  EXPECT_EQ(fit_light(view, to_sun, 4096, 4, 0.5, 6e-3).count, 1U);
  EXPECT_EQ(fit_light(view, to_sun, 64, 4, 0.5, 6e-4).count, 4U);
}

TEST(LightFit, fits_a_plane_seen_head_on) {
  ViewVolume view = view_at_ground();
  view.relworld_from_sensor = glm::dmat3({1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}, {0.0, 0.0, -1.0});
  view.scene_min_m = {-500.0, -500.0, -40.0};
  view.scene_max_m = {500.0, 500.0, -40.0};
  const LightFrusta frusta = fit_light(view, {0.0, 0.6, 0.8}, 1024, 1, 0.0, 6e-4);
  ASSERT_EQ(frusta.count, 1U);
  EXPECT_GT(frusta.cascades[0].extent_m.x, 15.0);
}

TEST(LightFit, sees_nothing_when_the_scene_is_behind_the_camera) {
  ViewVolume view = view_at_ground();
  view.scene_min_m = {-500.0, -500.0, 40.0};
  view.scene_max_m = {500.0, 500.0, 60.0};
  view.casters_min_m = view.scene_min_m;
  view.casters_max_m = view.scene_max_m;
  EXPECT_EQ(fit_light(view, {0.0, 0.0, 1.0}, 1024, 1, 0.5, 6e-4).count, 0U);
}

}  // namespace
}  // namespace emit::renderer
