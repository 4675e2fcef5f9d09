// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/coarse_geometry.hpp"

#include <gtest/gtest.h>

#include <array>

#include "renderer/scene/sphere.hpp"
#include "renderer/surface/surface_scene.hpp"

namespace emit::renderer {
namespace {

/// Makes ten spheres that share their mesh, seen from so far that a pixel is 3 cm wide.
scene::SceneGeometry many_spheres(scene::Mesh mesh) {
  scene::SceneGeometry geometry;
  for (int i = 0; i < 10; ++i) {
    scene::Instance instance;
    instance.object = static_cast<std::uint32_t>(i);
    instance.world_bounds = mesh.bounds;
    geometry.instances.push_back(instance);
    geometry.triangles += mesh.indices.size() / 3;
  }
  geometry.static_bounds = geometry.bounds = mesh.bounds;
  geometry.meshes.push_back(std::move(mesh));
  geometry.materials.resize(3);
  return geometry;
}

CoarseGeometry coarse(const scene::SceneGeometry& geometry, std::size_t max_samples,
                      double away_m = 30.0) {
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 1.0 + away_m)};
  const std::array<glm::vec3, 1> to_suns{glm::vec3(0.0F, 0.0F, 1.0F)};
  auto made = coarse_geometry(geometry, {eyes, 1e-3}, to_suns, max_samples);
  EXPECT_TRUE(made.has_value());
  return std::move(*made);
}

std::size_t vertices(const CoarseGeometry& made) {
  return 10 * made.geometry.meshes[0].positions_m.size();
}

TEST(CoarseGeometry, what_no_pixel_shows_goes_unseen) {
  const scene::SceneGeometry full = many_spheres(scene::sphere(60, false));
  const CoarseGeometry made = coarse(full, 100'000'000);
  EXPECT_FALSE(made.visibly);
  EXPECT_LT(made.geometry.triangles, full.triangles / 2);
  ASSERT_TRUE(made.detail.has_value());
  EXPECT_TRUE(made.detail->has(0));
}

TEST(CoarseGeometry, more_goes_until_vertices_leave_half_of_the_samples) {
  const scene::SceneGeometry full = many_spheres(scene::sphere(60, false));
  const CoarseGeometry with_kept = coarse(full, 100'000'000);
  EXPECT_FALSE(coarse(full, 2 * vertices(with_kept)).visibly);
  // Facets that are kept only to spare cuts go first, which does not show.
  const CoarseGeometry without = coarse(full, 2 * vertices(with_kept) - 1);
  EXPECT_FALSE(without.visibly);
  const std::size_t unseen = vertices(without);
  ASSERT_LT(unseen, vertices(with_kept));
  EXPECT_FALSE(coarse(full, 2 * unseen).visibly);
  const CoarseGeometry made = coarse(full, 2 * unseen - 1);
  EXPECT_TRUE(made.visibly);
  EXPECT_LT(vertices(made), unseen);
  // The surface moves no farther than eight times the error, so a sphere of a metre keeps its
  // shape.
  const CoarseGeometry least = coarse(full, 100);
  EXPECT_TRUE(least.visibly);
  EXPECT_LT(vertices(least), vertices(made));
  EXPECT_GT(vertices(least), 10U * 40U);
}

TEST(CoarseGeometry, outlines_of_small_bodies_stay_as_long_as_samples_are_left) {
  // The spheres are three pixels wide.
  const scene::SceneGeometry full = many_spheres(scene::sphere(60, false));
  const CoarseGeometry made = coarse(full, 100'000'000, 667.0);
  EXPECT_FALSE(made.visibly);
  const CoarseGeometry less = coarse(full, 2 * vertices(made) - 1, 667.0);
  EXPECT_FALSE(less.visibly);
  EXPECT_LT(less.geometry.triangles, made.geometry.triangles / 2);
  EXPECT_EQ(vertices(coarse(full, 2 * vertices(made), 667.0)), vertices(made));
}

TEST(CoarseGeometry, meshes_that_nothing_can_change_cost_the_others_nothing) {
  scene::SceneGeometry full = many_spheres(scene::sphere(60, false));
  const CoarseGeometry alone = coarse(full, 100'000'000);
  const std::size_t samples = 2 * vertices(alone);
  scene::Mesh moving = scene::sphere(240, false);
  ASSERT_GT(moving.positions_m.size(), samples);
  scene::Instance instance;
  instance.mesh = 1;
  instance.entity_id = 1;
  instance.object = 10;
  instance.world_bounds = {moving.bounds.min_m + 50.0, moving.bounds.max_m + 50.0};
  full.instances.push_back(instance);
  full.triangles += moving.indices.size() / 3;
  full.meshes.push_back(std::move(moving));
  const CoarseGeometry made = coarse(full, samples);
  EXPECT_FALSE(made.visibly);
  EXPECT_EQ(made.geometry.meshes[1].indices, full.meshes[1].indices);
  EXPECT_EQ(vertices(made), vertices(alone));
}

TEST(CoarseGeometry, what_would_hardly_spare_a_vertex_is_not_worth_being_seen) {
  // Every triangle has vertices of its own, as along hard edges.
  scene::Mesh mesh = scene::sphere(60, false);
  scene::Mesh hard = mesh;
  hard.positions_m.clear();
  hard.normals.clear();
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    hard.positions_m.push_back(mesh.positions_m[mesh.indices[i]]);
    hard.normals.push_back(mesh.normals[mesh.indices[i]]);
    hard.indices[i] = static_cast<std::uint32_t>(i);
  }
  EXPECT_FALSE(coarse(many_spheres(std::move(hard)), 100).visibly);
}

TEST(CoarseGeometry, meshes_of_wide_triangles_stay_as_they_are) {
  const scene::SceneGeometry full = many_spheres(scene::sphere(6, false));
  const CoarseGeometry made = coarse(full, 100);
  EXPECT_FALSE(made.visibly);
  EXPECT_FALSE(made.detail.has_value());
  EXPECT_EQ(made.geometry.meshes[0].indices, full.meshes[0].indices);
}

}  // namespace
}  // namespace emit::renderer
