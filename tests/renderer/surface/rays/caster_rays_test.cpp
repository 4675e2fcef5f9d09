// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "renderer/surface/surface_scene.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {
namespace {

using test::SurfaceScene;

constexpr glm::vec3 kUp{0.0F, 0.0F, 1.0F};
constexpr glm::vec3 kDown{0.0F, 0.0F, -1.0F};

CasterRays rays_of(const SurfaceScene& scene,
                   std::uint64_t flat_triangles = CasterRays::kFlatTriangles) {
  auto rays = CasterRays::create(scene.geometry, std::nullopt, flat_triangles);
  if (!rays) throw std::runtime_error(rays.error().text);
  return std::move(*rays);
}

glm::vec3 random_direction(std::mt19937& random) {
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  for (;;) {
    const glm::vec3 v(unit(random), unit(random), unit(random));
    const float length = glm::length(v);
    if (length > 0.1F && length < 1.0F) return v / length;
  }
}

scene::Mesh unit_plate() {
  return test::level_mesh(glm::vec3(-0.5F), glm::vec3(0.5F), 0.0F);
}

TEST(CasterRays, one_bit_per_ray_of_any_packet_size) {
  SurfaceScene scene;
  scene.add_static(unit_plate());
  const CasterRays casters = rays_of(scene);
  for (std::size_t count = 1; count <= CasterRays::kMaxRays; ++count) {
    std::vector<CasterRay> rays;
    std::uint32_t expected = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const bool under = i % 3 != 1;
      rays.push_back({{under ? 0.1F : 0.9F, 0.02F * static_cast<float>(i), -1.0F}, kUp});
      expected |= (under ? 1U : 0U) << i;
    }
    EXPECT_EQ(casters.blocked_static(rays), expected);
  }
  const CasterRay away{{0.1F, 0.0F, -1.0F}, kDown};
  EXPECT_EQ(casters.blocked_static({&away, 1}), 0U);
  EXPECT_EQ(casters.blocked_static({}), 0U);
}

TEST(CasterRays, one_packet_meets_an_entity_that_stands_elsewhere_for_every_ray) {
  SurfaceScene scene;
  scene.add_static(unit_plate(), glm::dvec3(0.0, 0.0, -50.0));
  scene.add_entity(test::box_mesh(glm::vec3(-0.6F, -0.4F, 0.0F), glm::vec3(0.6F, 0.4F, 0.9F)));
  const CasterRays casters = rays_of(scene);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-1.5F, 1.5F);
  std::size_t met = 0;
  for (int turn = 0; turn < 300; ++turn) {
    std::array<CasterRay, CasterRays::kMaxRays> rays;
    std::array<EntityPlacement, CasterRays::kMaxRays> placements;
    std::uint32_t expected = 0;
    const auto wanted = static_cast<std::uint32_t>(random()) & CasterRays::kAllRays;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      rays[i] = {{place(random), place(random), -1.0F}, random_direction(random)};
      placements[i].position_m = {place(random), place(random), place(random)};
      placements[i].rel_from_body = glm::mat3(
          glm::rotate(glm::mat4(1.0F), 3.0F * place(random), glm::vec3(0.0F, 0.0F, 1.0F)));
      placements[i].on = i % 5 != 2;
      if (((wanted >> i) & 1U) == 0U) continue;
      expected |= casters.blocked_entity(0, placements[i], {&rays[i], 1}) << i;
    }
    EXPECT_EQ(casters.blocked_moving(0, placements, rays, wanted), expected);
    met += expected != 0 ? 1U : 0U;
  }
  EXPECT_GT(met, 50U);
}

TEST(CasterRays, a_packet_that_passes_an_entity_by_meets_what_single_rays_meet) {
  SurfaceScene scene;
  scene.add_static(unit_plate(), glm::dvec3(0.0, 0.0, -50.0));
  scene.add_entity(test::box_mesh(glm::vec3(-0.6F, -0.4F, 0.0F), glm::vec3(0.6F, 0.4F, 0.9F)));
  scene.add_entity(test::box_mesh(glm::vec3(-9.0F, -0.4F, 0.0F), glm::vec3(9.0F, 0.4F, 0.9F)));
  const CasterRays casters = rays_of(scene);
  std::mt19937 random(6);
  std::uniform_real_distribution<float> place(-30.0F, 30.0F);
  for (int turn = 0; turn < 500; ++turn) {
    std::array<EntityPlacement, 2> entities;
    for (EntityPlacement& entity : entities) {
      entity.position_m = {place(random), place(random), place(random)};
    }
    // The rays go from one point towards all sides, or side by side, as different queries send
    // them.
    std::array<CasterRay, CasterRays::kMaxRays> rays;
    const glm::vec3 along = random_direction(random);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const float spread = turn % 3 == 0 ? 1.0F : 0.05F;
      rays[i].direction = glm::normalize(along + spread * random_direction(random));
      rays[i].origin_m = turn % 2 == 0 ? glm::vec3(0.0F) : 2.0F * random_direction(random);
    }
    std::array<CasterHit, CasterRays::kMaxRays> hits;
    const CasterSelection selection{true, entities};
    const std::uint32_t blocked = casters.blocked(rays, selection);
    const std::uint32_t hit = casters.first_hits(rays, selection, hits);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      EXPECT_EQ((blocked >> i) & 1U, casters.blocked({&rays[i], 1}, selection));
      CasterHit alone;
      EXPECT_EQ((hit >> i) & 1U, casters.first_hits({&rays[i], 1}, selection, {&alone, 1}));
    }
  }
}

TEST(CasterRays, millimetres_hold_100_km_from_the_origin_of_the_world) {
  SurfaceScene scene;
  const glm::dvec3 place_m(1e5 + 0.125, -7.3e4, 900.0);
  scene.add_static(unit_plate(), place_m);
  const CasterRays casters = rays_of(scene);
  EXPECT_NEAR(glm::distance(casters.origin_world_m(), place_m), 0.0, 1e-9);
  for (const double x_m : {0.499, 0.501}) {
    const glm::vec3 start(place_m + glm::dvec3(x_m, 0.0, -1.0) - casters.origin_world_m());
    const CasterRay ray{start, kUp};
    EXPECT_EQ(casters.blocked_static({&ray, 1}), x_m < 0.5 ? 1U : 0U);
  }
}

TEST(CasterRays, a_hit_names_instance_triangle_and_place) {
  SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-50.0F), glm::vec3(50.0F), -5.0F));
  glm::dmat4 turned = glm::translate(glm::dmat4(1.0), glm::dvec3(3.0, 2.0, 1.0));
  turned = glm::rotate(turned, 0.7, glm::normalize(glm::dvec3(1.0, 2.0, 3.0)));
  turned = glm::scale(turned, glm::dvec3(1.0, 2.0, 0.5));
  const std::uint32_t box =
      scene.add_static(scene.add_mesh(test::box_mesh(glm::vec3(-1.0F), glm::vec3(1.0F))), turned);
  const CasterRays casters = rays_of(scene);
  const scene::Mesh& mesh = scene.geometry.meshes[1];

  std::mt19937 random(3);
  int on_box = 0;
  for (int i = 0; i < 500; ++i) {
    const glm::vec3 target(glm::dvec3(3.0, 2.0, 1.0) - casters.origin_world_m());
    const glm::vec3 direction = random_direction(random);
    const CasterRay ray{target - 20.0F * direction + 0.7F * random_direction(random), direction};
    const auto hit = casters.first_hit(ray, {});
    if (!hit || hit->instance != box) continue;
    ++on_box;
    EXPECT_TRUE(hit->front);
    EXPECT_LT(glm::dot(hit->normal, direction), 0.0F);
    std::array<glm::dvec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3& p = mesh.positions_m[mesh.indices[3 * std::size_t{hit->triangle} + k]];
      corners[k] = glm::dvec3(turned * glm::dvec4(glm::dvec3(p), 1.0)) - casters.origin_world_m();
    }
    const double u = hit->barycentric.x;
    const double v = hit->barycentric.y;
    const glm::dvec3 by_weights = (1.0 - u - v) * corners[0] + u * corners[1] + v * corners[2];
    const glm::dvec3 by_distance(ray.origin_m + hit->distance_m * direction);
    EXPECT_LT(glm::distance(by_weights, by_distance), 2e-5);
    const glm::dvec3 normal =
        glm::normalize(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
    EXPECT_LT(glm::distance(normal, glm::dvec3(hit->normal)), 1e-5);
  }
  EXPECT_GT(on_box, 300);
}

TEST(CasterRays, no_ray_leaves_a_closed_body) {
  SurfaceScene scene;
  scene.add_static(test::box_mesh(glm::vec3(-1.0F, -1.5F, -0.7F), glm::vec3(1.0F, 1.5F, 0.7F)));
  const CasterRays casters = rays_of(scene);
  std::mt19937 random(5);
  std::vector<CasterRay> rays;
  for (int i = 0; i < 20000; ++i) {
    // Every other ray aims at an edge or a corner.
    glm::vec3 direction = random_direction(random);
    if (i % 2 == 0) {
      direction = {1.0F, i % 4 == 0 ? -1.5F : direction.y, 0.7F};
      direction = glm::normalize(direction);
    }
    rays.push_back({0.0F * direction, direction});
    if (rays.size() < CasterRays::kMaxRays) continue;
    ASSERT_EQ(casters.blocked_static(rays), 0xffffU);
    rays.clear();
  }
  const auto hit = casters.first_hit({{0.0F, 0.0F, 0.0F}, kUp}, {});
  ASSERT_TRUE(hit.has_value());
  EXPECT_FALSE(hit->front);  // its outside is above
  EXPECT_NEAR(hit->normal.z, 1.0F, 1e-6F);
  EXPECT_NEAR(hit->distance_m, 0.7F, 1e-6F);
}

TEST(CasterRays, an_entity_blocks_where_it_stands) {
  SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-9.0F), glm::vec3(9.0F), 0.0F));
  // The box is 4 m long in body x; the set's centre is off the body's origin.
  scene.add_entity(test::box_mesh(glm::vec3(0.0F, -0.5F, -0.5F), glm::vec3(4.0F, 0.5F, 0.5F)));
  const CasterRays casters = rays_of(scene);
  ASSERT_EQ(casters.entities(), 1U);
  EntityPlacement east{glm::mat3(1.0F), {1.0F, 0.0F, 3.0F}, true};
  EntityPlacement north = east;
  north.rel_from_body = glm::mat3(glm::vec3(0.0F, 1.0F, 0.0F), glm::vec3(-1.0F, 0.0F, 0.0F), kUp);
  const std::array<CasterRay, 3> rays = {CasterRay{{4.0F, 0.0F, 0.1F}, kUp},
                                         CasterRay{{1.0F, 3.0F, 0.1F}, kUp},
                                         CasterRay{{-1.0F, 0.0F, 0.1F}, kUp}};
  EXPECT_EQ(casters.blocked_entity(0, east, rays), 1U);
  EXPECT_EQ(casters.blocked_entity(0, north, rays), 2U);
  east.on = false;
  EXPECT_EQ(casters.blocked_entity(0, east, rays), 0U);
  EXPECT_EQ(casters.blocked_static(rays), 0U);

  // The ray meets the nearer of ground and entity. The normal comes back in rel axes.
  const CasterRay from_above{{1.0F, 3.0F, 8.0F}, kDown};
  auto hit = casters.first_hit(from_above, {&north, 1});
  ASSERT_TRUE(hit.has_value());
  EXPECT_EQ(hit->instance, 1U);
  EXPECT_NEAR(hit->distance_m, 4.5F, 1e-5F);
  const CasterRay from_east{{9.0F, 3.0F, 3.0F}, {-1.0F, 0.0F, 0.0F}};
  hit = casters.first_hit(from_east, {&north, 1});
  ASSERT_TRUE(hit.has_value());
  EXPECT_LT(glm::distance(hit->normal, glm::vec3(1.0F, 0.0F, 0.0F)), 1e-6F);
  hit = casters.first_hit(from_above, {&east, 1});
  ASSERT_TRUE(hit.has_value());
  EXPECT_EQ(hit->instance, 0U);
  EXPECT_TRUE(hit->front);
  CasterHit only;
  EXPECT_EQ(casters.first_hits({&from_above, 1}, {false, {&east, 1}}, {&only, 1}), 0U);
}

TEST(CasterRays, nothing_is_lost_by_skipping_far_entities) {
  SurfaceScene scene;
  scene.add_entity(test::box_mesh(glm::vec3(2.0F, -0.5F, -0.5F), glm::vec3(6.0F, 0.5F, 0.5F)));
  const CasterRays casters = rays_of(scene);
  std::mt19937 random(8);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  int blocked = 0;
  for (int i = 0; i < 4000; ++i) {
    // The ray starts far off, where rounding is at its worst, and aims into the box's inner half.
    const glm::vec3 direction = random_direction(random);
    const EntityPlacement placement{glm::mat3(1.0F), 1e5F * random_direction(random), true};
    const glm::vec3 inside(4.0F + unit(random), 0.25F * unit(random), 0.25F * unit(random));
    const CasterRay ray{placement.position_m + inside - 1e4F * direction, direction};
    blocked += casters.blocked_entity(0, placement, {&ray, 1}) != 0U ? 1 : 0;
  }
  EXPECT_EQ(blocked, 4000);

  const std::array<CasterRay, 2> body = {CasterRay{{0.0F, 0.4999F, 0.0F}, {1.0F, 0.0F, 0.0F}},
                                         CasterRay{{0.0F, 0.5001F, 0.0F}, {1.0F, 0.0F, 0.0F}}};
  EXPECT_EQ(casters.blocked_in_body(0, body), 1U);
}

TEST(CasterRays, entities_come_in_the_order_of_their_objects) {
  SurfaceScene scene;
  scene.add_entity(unit_plate());
  scene.add_static(unit_plate());
  scene.add_entity(unit_plate());
  scene.geometry.instances[0].object = 7;
  scene.geometry.instances[2].object = 4;
  const CasterRays casters = rays_of(scene);
  ASSERT_EQ(casters.entities(), 2U);
  EXPECT_EQ(casters.object_of_entity(0), 4U);
  EXPECT_EQ(casters.object_of_entity(1), 7U);
}

/// The instances are listed one by one, and as instances of one mesh.
TEST(CasterRays, ten_thousand_instances_of_a_mesh) {
  SurfaceScene scene;
  const std::uint32_t ground =
      scene.add_static(test::level_mesh(glm::vec3(-1.0F), glm::vec3(201.0F), -4.0F));
  const std::uint32_t mesh = scene.add_mesh(test::grid_mesh(16));  // 5 million triangles in all
  for (int i = 0; i < 10000; ++i) {
    glm::dmat4 place = glm::translate(glm::dmat4(1.0), glm::dvec3(2 * (i % 100), 2 * (i / 100), 0));
    place = glm::rotate(place, 0.5, glm::dvec3(0.0, 1.0, 0.0));
    scene.add_static(mesh, glm::scale(place, glm::dvec3(1.0, 0.5, 3.0)));
  }
  for (const std::uint64_t flat_triangles : {CasterRays::kFlatTriangles, std::uint64_t{1000}}) {
    SCOPED_TRACE(flat_triangles);
    const CasterRays casters = rays_of(scene, flat_triangles);
    const glm::vec3 tilted(std::sin(0.5F), 0.0F, std::cos(0.5F));
    for (const int i : {0, 99, 4711, 9999}) {
      const scene::Instance& instance = scene.geometry.instances[static_cast<std::size_t>(i) + 1];
      // The ray aims at the middle of the first triangle of cell (5, 3).
      const glm::dvec4 place_mesh((5.0 + 2.0 / 3.0) / 16.0, (3.0 + 1.0 / 3.0) / 16.0, 0.0, 1.0);
      const glm::vec3 place(glm::dvec3(instance.world_from_mesh * place_mesh) -
                            casters.origin_world_m());
      const auto hit = casters.first_hit({place + 5.0F * kUp, kDown}, {});
      ASSERT_TRUE(hit.has_value());
      EXPECT_EQ(hit->instance, static_cast<std::uint32_t>(i) + 1);
      EXPECT_EQ(hit->triangle, 2U * (3U * 16U + 5U));
      EXPECT_NEAR(hit->barycentric.x, 1.0F / 3.0F, 5e-3F);
      EXPECT_NEAR(hit->barycentric.y, 1.0F / 3.0F, 5e-3F);
      EXPECT_NEAR(hit->distance_m, 5.0F, 1e-4F);
      EXPECT_LT(glm::distance(hit->normal, tilted), 1e-5F);
      const std::array<CasterRay, 2> rays = {CasterRay{place - kUp, kUp},
                                             CasterRay{place - glm::vec3(0.0F, 0.4F, 1.0F), kUp}};
      EXPECT_EQ(casters.blocked_static(rays), 1U);
      const auto below = casters.first_hit({place - 0.1F * kUp, kDown}, {});
      ASSERT_TRUE(below.has_value());
      EXPECT_EQ(below->instance, ground);
    }
  }
}

TEST(CasterRays, refuses_what_it_cannot_trace) {
  SurfaceScene scene;
  scene.add_static(unit_plate());
  scene.geometry.meshes[0].indices[4] = 9;
  auto rays = CasterRays::create(scene.geometry);
  ASSERT_FALSE(rays.has_value());
  EXPECT_EQ(rays.error().code, physics::ErrorCode::invalid_argument);
  EXPECT_NE(rays.error().text.find("index 9"), std::string::npos);

  SurfaceScene wide;
  wide.add_static(unit_plate());
  wide.add_static(unit_plate(), {1e9, 0.0, 0.0});
  rays = CasterRays::create(wide.geometry);
  ASSERT_FALSE(rays.has_value());
  EXPECT_EQ(rays.error().code, physics::ErrorCode::invalid_argument);
}

TEST(CasterRays, an_empty_scene_blocks_nothing_and_broken_triangles_are_left_out) {
  SurfaceScene scene;
  const CasterRay ray{{0.1F, 0.2F, -1.0F}, kUp};
  const CasterRays nothing = rays_of(scene);
  EXPECT_EQ(nothing.blocked_static({&ray, 1}), 0U);
  EXPECT_FALSE(nothing.first_hit(ray, {}).has_value());

  scene.add_static(unit_plate());
  scene.geometry.meshes[0].positions_m[3].x = std::numeric_limits<float>::quiet_NaN();
  const CasterRays half = rays_of(scene);
  const std::array<CasterRay, 2> pair = {CasterRay{{0.2F, 0.1F, -1.0F}, kUp},
                                         CasterRay{{0.1F, 0.2F, -1.0F}, kUp}};
  EXPECT_EQ(half.blocked_static(pair), 1U);
}

}  // namespace
}  // namespace emit::renderer
