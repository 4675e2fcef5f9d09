// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/bulk_bounds.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <random>

#include "renderer/surface/surface_scene.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

using test::SurfaceScene;

/// Makes a street of boxes on ground.
SurfaceScene street() {
  SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-60.0F), glm::vec3(60.0F), 0.0F));
  for (int i = 0; i < 12; ++i) {
    scene.add_static(test::box_mesh(glm::vec3(-2.0F), glm::vec3(2.0F)),
                     glm::dvec3(8.0 * i - 44.0, 5.0, 2.0));
  }
  return scene;
}

/// Makes a triangle of one metre.
scene::Mesh small_triangle() {
  scene::Mesh mesh;
  mesh.positions_m = {{0.0F, 0.0F, 0.0F}, {1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}};
  mesh.normals.assign(3, glm::vec3(0.0F, 0.0F, 1.0F));
  mesh.indices = {0, 1, 2};
  mesh.submeshes = {{0, 3, 0, false}};
  for (const glm::vec3& p : mesh.positions_m) mesh.bounds.add(glm::dvec3(p));
  return mesh;
}

TEST(BulkBounds, are_the_box_of_all_of_an_ordinary_scene) {
  const scene::Aabb box = bulk_bounds(street().geometry);
  EXPECT_EQ(box.min_m, glm::dvec3(-60.0, -60.0, 0.0));
  EXPECT_EQ(box.max_m, glm::dvec3(60.0, 60.0, 4.0));
  // The bounds of a wide scene are wide.
  SurfaceScene wide;
  for (int i = 0; i < 50; ++i) {
    wide.add_static(test::box_mesh(glm::vec3(-2.0F), glm::vec3(2.0F)), glm::dvec3(200.0 * i));
  }
  EXPECT_EQ(bulk_bounds(wide.geometry).max_m, glm::dvec3(9802.0));
  EXPECT_TRUE(bulk_bounds(scene::SceneGeometry{}).empty());
}

TEST(BulkBounds, leave_strays_out_wherever_they_are) {
  for (const glm::dvec3& far_m :
       {glm::dvec3(0.0, 0.0, -6e6), glm::dvec3(2e5, 0.0, 0.0), glm::dvec3(-3e6, 4e6, 1e3)}) {
    SurfaceScene scene = street();
    scene.add_static(small_triangle(), far_m);
    const scene::Aabb box = bulk_bounds(scene.geometry);
    EXPECT_LT(glm::length(box.max_m - box.min_m), 300.0);
    EXPECT_GT(glm::length(box.max_m - box.min_m), 80.0);
    EXPECT_LT(glm::length(0.5 * (box.min_m + box.max_m)), 30.0);
    auto rays = CasterRays::create(scene.geometry);
    ASSERT_TRUE(rays);
    EXPECT_LT(glm::length(rays->origin_world_m()), 30.0);
  }
}

TEST(BulkBounds, of_a_scene_with_strays_are_those_of_the_scene_without_them) {
  // The street stands aside, turned, and is not symmetrical.
  const auto make = [] {
    SurfaceScene scene;
    glm::dmat4 placed = glm::translate(glm::dmat4(1.0), glm::dvec3(137.3, -41.7, 12.9));
    placed = glm::rotate(placed, 0.3, glm::dvec3(0.0, 0.0, 1.0));
    const std::uint32_t plane =
        scene.add_mesh(test::level_mesh(glm::vec3(-60.0F), glm::vec3(45.0F), 0.0F));
    scene.add_static(plane, placed);
    const std::uint32_t house =
        scene.add_mesh(test::box_mesh(glm::vec3(-2.0F), glm::vec3(2.0F, 2.0F, 7.3F)));
    for (int i = 0; i < 12; ++i) {
      scene.add_static(house,
                       glm::translate(placed, glm::dvec3(6.0 * i - 44.0, 5.0 * (i % 3), 0.0)));
    }
    return scene;
  };
  const scene::Aabb clean = bulk_bounds(make().geometry);
  for (const glm::dvec3& far_m :
       {glm::dvec3(0.0, 0.0, -6e6), glm::dvec3(2e5, 0.0, 0.0), glm::dvec3(-3e6, 4e6, 1e3)}) {
    SurfaceScene scene = make();
    scene.add_static(small_triangle(), far_m);
    const scene::Aabb box = bulk_bounds(scene.geometry);
    EXPECT_EQ(box.min_m, clean.min_m);
    EXPECT_EQ(box.max_m, clean.max_m);
  }
}

TEST(BulkBounds, know_a_stray_inside_a_mesh) {
  SurfaceScene scene;
  scene::Mesh mesh = test::grid_mesh(16);
  for (glm::vec3& p : mesh.positions_m) p *= 40.0F;
  test::add_quad(mesh, {glm::vec3(5e6F, 0.0F, 0.0F), glm::vec3(5.00001e6F, 0.0F, 0.0F),
                        glm::vec3(5.00001e6F, 9.0F, 0.0F), glm::vec3(5e6F, 9.0F, 0.0F)});
  scene.add_static(mesh);
  const scene::Aabb box = bulk_bounds(scene.geometry);
  EXPECT_LT(box.max_m.x, 100.0);
  EXPECT_GT(box.max_m.x, 38.0);
}

TEST(BulkBounds, of_a_scene_with_entities_are_those_of_what_stands_still) {
  SurfaceScene scene = street();
  scene.add_entity(small_triangle(), glm::translate(glm::dmat4(1.0), glm::dvec3(0.0, 0.0, -6e6)));
  EXPECT_EQ(bulk_bounds(scene.geometry).max_m, glm::dvec3(60.0, 60.0, 4.0));
}

TEST(RayOffsets, grow_with_the_distance_from_the_origin_where_float32_resolves_less) {
  EXPECT_EQ(ray_offsets(glm::vec3(0.0F), 4.0F).sun_m, RayOffsets().sun_m);
  EXPECT_FLOAT_EQ(ray_offsets(glm::vec3(60.0F, 60.0F, 2.0F), 4.0F).sun_m,
                  1e-6F * std::sqrt(7204.0F));
  EXPECT_EQ(ray_offsets(glm::vec3(60.0F, 60.0F, 2.0F), 4.0F).around_m, RayOffsets().around_m);
  EXPECT_FLOAT_EQ(ray_offsets(glm::vec3(0.0F, 5e6F, 0.0F), 4.0F).sun_m, 5.0F);
  EXPECT_FLOAT_EQ(ray_offsets(glm::vec3(0.0F, 5e6F, 0.0F), 4.0F).around_m, 5.0F);
  EXPECT_FLOAT_EQ(ray_offsets(glm::vec3(0.0F), 5e5F).around_m, 0.5F);
}

TEST(RayOffsets, ClearTheTriangleOnWhichAPlaceLiesWhateverItsSizeTiltAndDistance) {
  // A place on a triangle, as float32 holds it, must not meet the triangle itself.
  std::mt19937 random(5);
  std::uniform_real_distribution<float> any(-1.0F, 1.0F);
  for (const float size_m : {1e-2F, 1.0F, 100.0F, 1e4F, 1e6F}) {
    for (const float away_m : {0.0F, 10.0F, 1e3F, 1e5F}) {
      int met = 0;
      for (int i = 0; i < 40; ++i) {
        const auto somewhere = [&](float reach_m) {
          return reach_m * glm::vec3(any(random), any(random), any(random));
        };
        const glm::vec3 middle_m = somewhere(away_m);
        scene::Mesh mesh;
        const glm::vec3 last_m = middle_m + somewhere(size_m);
        test::add_quad(
            mesh, {middle_m + somewhere(size_m), middle_m + somewhere(size_m), last_m, last_m});
        mesh.indices.resize(3);
        mesh.submeshes.front().index_count = 3;
        const glm::vec3* p = mesh.positions_m.data();
        const glm::dvec3 across =
            glm::cross(glm::dvec3(p[1]) - glm::dvec3(p[0]), glm::dvec3(p[2]) - glm::dvec3(p[0]));
        const float longest_m = std::max(
            {glm::distance(p[0], p[1]), glm::distance(p[1], p[2]), glm::distance(p[2], p[0])});
        if (glm::length(across) < 0.01 * longest_m * longest_m) continue;
        const glm::vec3 normal(glm::normalize(across));
        SurfaceScene scene;
        scene.add_static(mesh);
        const auto rays = CasterRays::create(scene.geometry, glm::dvec3(0.0));
        ASSERT_TRUE(rays);
        for (int k = 0; k < 40; ++k) {
          const float u = 0.5F * std::abs(any(random));
          const float v = 0.5F * std::abs(any(random));
          const glm::vec3 at_m = (1.0F - u - v) * p[0] + u * p[1] + v * p[2];
          glm::vec3 way = glm::normalize(somewhere(1.0F));
          if (glm::dot(way, normal) < 0.0F) way = -way;
          const CasterRay ray{at_m + ray_offsets(at_m, longest_m).sun_m * normal, way};
          met += static_cast<int>(rays->blocked_static({&ray, 1}));
        }
      }
      EXPECT_EQ(met, 0) << size_m << " m wide, " << away_m << " m away";
    }
  }
}

}  // namespace
}  // namespace emit::renderer
