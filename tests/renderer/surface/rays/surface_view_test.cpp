// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <span>
#include <stdexcept>
#include <utility>

#include "emit/physics/constants.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {
namespace {

using test::SurfaceScene;

constexpr glm::vec3 kZenith{0.0F, 0.0F, 1.0F};

CasterRays rays_through(const SurfaceScene& scene) {
  auto rays = CasterRays::create(scene.geometry);
  if (!rays) throw std::runtime_error(rays.error().text);
  return std::move(*rays);
}

/// Share of a hemisphere taken by a polygon wholly above the point's plane (Lambert 1760),
/// counter-clockwise seen from the point.
double polygon_frac(const glm::dvec3& point, const glm::dvec3& normal,
                    std::span<const glm::dvec3> corners) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec3 a = glm::normalize(corners[i] - point);
    const glm::dvec3 b = glm::normalize(corners[(i + 1) % corners.size()] - point);
    const glm::dvec3 axis = glm::cross(a, b);
    sum += std::atan2(glm::length(axis), glm::dot(a, b)) * glm::normalize(axis);
  }
  return std::abs(glm::dot(sum, normal)) / (2.0 * physics::kPi);
}

double total_frac(const SurfaceView& view) {
  double total = static_cast<double>(view.sky_frac) + view.far_frac;
  for (std::size_t i = 0; i < view.seen_count; ++i) total += view.seen[i].weight_frac;
  return total;
}

double instance_frac(const SurfaceView& view, std::uint32_t instance) {
  double total = 0.0;
  for (std::size_t i = 0; i < view.seen_count; ++i) {
    if (view.seen[i].instance == instance) total += view.seen[i].weight_frac;
  }
  return total;
}

/// Returns `point.position_m` in world coordinates.
SurfaceView view_of(const CasterRays& casters, ViewPoint point, std::uint32_t rays = 256) {
  point.position_m -= glm::vec3(casters.origin_world_m());
  return ViewSampler(rays).view(casters, point, {});
}

scene::Mesh ground() {
  return test::level_mesh(glm::vec3(-1e4F), glm::vec3(1e4F), 0.0F);
}

TEST(SurfaceView, shares_are_those_of_the_view) {
  SurfaceScene scene;
  scene.add_static(ground());
  scene.add_static(test::level_mesh({1.0F, -2.0F, 0.0F}, {4.0F, 2.0F, 0.0F}, 2.0F));
  const CasterRays casters = rays_through(scene);
  const ViewSampler sampler(256);
  for (const glm::vec3& normal :
       {kZenith, glm::vec3(1.0F, 0.0F, 0.0F), glm::vec3(0.6F, 0.0F, 0.8F)}) {
    const ViewPoint point{glm::vec3(0.0F, 0.0F, 0.5F) - glm::vec3(casters.origin_world_m()), normal,
                          glm::vec3(0.0F), 1e-3F};
    const SurfaceView view = sampler.view(casters, point, {});
    const ViewShares shares = sampler.shares(casters, point, {});
    EXPECT_FLOAT_EQ(shares.sky_frac, view.sky_frac);
    EXPECT_FLOAT_EQ(shares.far_frac, view.far_frac);
  }
}

TEST(SurfaceView, shares_of_a_free_face_are_exact) {
  SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-1.0F), glm::vec3(1.0F), 0.0F));
  const CasterRays casters = rays_through(scene);
  const ViewSampler sampler(1024);
  for (float tilt_rad = 0.0F; tilt_rad < 3.0F; tilt_rad += 0.1F) {
    const ViewPoint point{{9000.0F, 0.0F, 50.0F},
                          {std::sin(tilt_rad), 0.0F, std::cos(tilt_rad)},
                          glm::vec3(0.0F),
                          1e-3F};
    const ViewShares shares = sampler.shares(casters, point, {});
    EXPECT_NEAR(shares.sky_frac + shares.far_frac, 1.0F, 2e-3F);
    EXPECT_NEAR(shares.sky_frac, 0.5F * (1.0F + std::cos(tilt_rad)), 1e-6F) << tilt_rad;
  }
}

TEST(SurfaceView, shares_tell_what_a_turn_of_the_face_changes) {
  SurfaceScene scene;
  scene.add_static(ground());
  const CasterRays casters = rays_through(scene);
  const ViewSampler sampler(1024);
  const auto at = [&](float tilt_rad) {
    const ViewPoint point{glm::vec3(0.0F, 0.0F, 0.5F) - glm::vec3(casters.origin_world_m()),
                          {std::sin(tilt_rad), 0.0F, std::cos(tilt_rad)},
                          glm::vec3(0.0F),
                          1e-3F};
    return std::pair(sampler.shares(casters, point, {}), point.normal);
  };
  for (const float tilt_rad : {0.1F, 0.8F, 1.5F, 2.2F}) {
    const auto [shares, normal] = at(tilt_rad);
    const auto [turned, turned_normal] = at(tilt_rad + 0.2F);
    EXPECT_NEAR(turned.sky_frac - shares.sky_frac,
                glm::dot(0.5F * (shares.to_sky + turned.to_sky), turned_normal - normal), 0.01F);
  }
}

TEST(SurfaceView, the_opening_of_a_free_face_gives_the_sky_of_every_attitude) {
  SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-1.0F), glm::vec3(1.0F), 0.0F));
  const CasterRays casters = rays_through(scene);
  const ViewOpening opening = ViewSampler(1024).opening(
      casters,
      {.position_m = {0.0F, 0.0F, 500.0F}, .normal = glm::normalize(glm::vec3(1.0F, 2.0F, 2.0F))},
      {});
  EXPECT_EQ(opening.open_frac, 1.0F);
  // Compare with the view factor of a tilted plane, (1 + cos tilt) / 2.
  for (const glm::vec3& up :
       {kZenith, -kZenith, glm::vec3(1.0F, 0.0F, 0.0F), glm::vec3(0.6F, 0.0F, 0.8F)}) {
    const float cosine = glm::dot(up, glm::normalize(glm::vec3(1.0F, 2.0F, 2.0F)));
    EXPECT_NEAR(0.5F * opening.open_frac + glm::dot(opening.tilt_frac, up), 0.5F * (1.0F + cosine),
                1e-6F);
  }
}

TEST(SurfaceView, the_opening_at_the_foot_of_a_wall_gives_the_sky_to_a_tenth) {
  SurfaceScene scene;
  scene.add_static(ground());
  scene.add_static(test::box_mesh(glm::vec3(0.0F, -5e3F, 0.0F), glm::vec3(1.0F, 5e3F, 5e3F)));
  const CasterRays casters = rays_through(scene);
  ViewPoint foot{.inward = {-1.0F, 0.0F, 0.0F}, .offset_m = 2e-3F};
  foot.position_m -= glm::vec3(casters.origin_world_m());
  const ViewOpening opening = ViewSampler(1024).opening(casters, foot, {});
  EXPECT_NEAR(opening.open_frac, 0.5F, 0.01F);
  const auto sky_frac = [&](const glm::vec3& up) {
    return 0.5F * opening.open_frac + glm::dot(opening.tilt_frac, up);
  };
  // Upright, all that is open is sky. With the wall below it is too, but the second order
  // gives only 1/4 + 1/(2 pi).
  EXPECT_NEAR(sky_frac(kZenith), 0.5F, 0.01F);
  EXPECT_NEAR(sky_frac(-kZenith), 0.0F, 0.01F);
  EXPECT_NEAR(sky_frac({-1.0F, 0.0F, 0.0F}), 0.5F, 0.1F);
  EXPECT_NEAR(sky_frac({0.0F, 1.0F, 0.0F}), 0.25F, 0.01F);
}

TEST(SurfaceView, open_ground_sees_the_sky_alone) {
  SurfaceScene scene;
  scene.add_static(ground());
  const CasterRays casters = rays_through(scene);
  for (const std::uint32_t rays : {1U, 64U, 100U, 256U, 1000U}) {
    const SurfaceView view = view_of(casters, {.position_m = {3.0F, 2.0F, 0.0F}}, rays);
    EXPECT_EQ(view.sky_frac, 1.0F);
    EXPECT_EQ(view.far_frac, 0.0F);
    EXPECT_EQ(view.seen_count, 0U);
  }
  // The underside looks away from the sky, and nothing is there.
  const SurfaceView below = view_of(casters, {.normal = -kZenith});
  EXPECT_EQ(below.far_frac, 1.0F);
}

TEST(SurfaceView, the_foot_of_a_wall_sees_half_of_the_sky) {
  SurfaceScene scene;
  scene.add_static(ground());
  const std::uint32_t wall =
      scene.add_static(test::box_mesh(glm::vec3(0.0F, -5e3F, 0.0F), glm::vec3(1.0F, 5e3F, 5e3F)));
  const CasterRays casters = rays_through(scene);
  const ViewPoint foot{.inward = {-1.0F, 0.0F, 0.0F}, .offset_m = 2e-3F};
  for (const std::uint32_t rays : {64U, 256U}) {
    const SurfaceView view = view_of(casters, foot, rays);
    EXPECT_NEAR(view.sky_frac, 0.5F, rays == 64U ? 0.03F : 0.01F);
    EXPECT_NEAR(instance_frac(view, wall), 1.0 - view.sky_frac, 1e-6);
    for (std::size_t i = 0; i < view.seen_count; ++i) {
      EXPECT_TRUE(view.seen[i].front);
      EXPECT_LT(view.seen[i].normal.x, -0.999F);
    }
  }
  // The wall sees sky and ground by halves. Without ground the lower half shows the far
  // surroundings.
  const ViewPoint middle{.position_m = {0.0F, 0.0F, 2.0F}, .normal = {-1.0F, 0.0F, 0.0F}};
  const SurfaceView view = view_of(casters, middle);
  EXPECT_NEAR(view.sky_frac, 0.5F, 0.01F);
  EXPECT_NEAR(instance_frac(view, 0), 0.5, 0.01);
  scene.geometry.instances.erase(scene.geometry.instances.begin());
  const SurfaceView bare = view_of(rays_through(scene), middle);
  EXPECT_EQ(bare.sky_frac, view.sky_frac);
  EXPECT_NEAR(bare.far_frac, 0.5F, 0.01F);
}

TEST(SurfaceView, a_plate_overhead_takes_its_view_factor) {
  SurfaceScene scene;
  scene.add_static(ground());
  const std::uint32_t plate =
      scene.add_static(test::level_mesh(glm::vec3(-2.0F), glm::vec3(2.0F), 1.5F));
  const CasterRays casters = rays_through(scene);
  const std::array<glm::dvec3, 4> corners = {glm::dvec3(-2, -2, 1.5), glm::dvec3(2, -2, 1.5),
                                             glm::dvec3(2, 2, 1.5), glm::dvec3(-2, 2, 1.5)};
  std::mt19937 random(2);
  std::uniform_real_distribution<float> unit(-3.0F, 3.0F);
  double worst[2] = {0.0, 0.0};
  for (int i = 0; i < 200; ++i) {
    const ViewPoint point{.position_m = {unit(random), unit(random), 0.0F}};
    const double exact =
        polygon_frac(glm::dvec3(point.position_m), glm::dvec3(0.0, 0.0, 1.0), corners);
    for (const std::size_t k : {0U, 1U}) {
      const SurfaceView view = view_of(casters, point, k == 0 ? 64 : 256);
      EXPECT_NEAR(total_frac(view), 1.0, 1e-5);
      EXPECT_NEAR(instance_frac(view, plate), 1.0 - view.sky_frac, 1e-5);
      for (std::size_t s = 0; s < view.seen_count; ++s) EXPECT_FALSE(view.seen[s].front);
      worst[k] = std::max(worst[k], std::abs(instance_frac(view, plate) - exact));
    }
  }
  EXPECT_LT(worst[0], 0.05);
  EXPECT_LT(worst[1], 0.02);
}

TEST(SurfaceView, ground_beside_a_cube_sees_its_near_face) {
  SurfaceScene scene;
  scene.add_static(ground());
  const std::uint32_t cube =
      scene.add_static(test::box_mesh(glm::vec3(0.0F, -1.0F, 0.0F), glm::vec3(2.0F, 1.0F, 2.0F)));
  const CasterRays casters = rays_through(scene);
  const std::array<glm::dvec3, 4> face = {glm::dvec3(0, -1, 0), glm::dvec3(0, 1, 0),
                                          glm::dvec3(0, 1, 2), glm::dvec3(0, -1, 2)};
  for (const float distance_m : {0.05F, 0.3F, 1.0F, 3.0F}) {
    const ViewPoint point{.position_m = {-distance_m, 0.2F, 0.0F}};
    const SurfaceView view = view_of(casters, point);
    EXPECT_NEAR(instance_frac(view, cube),
                polygon_frac(glm::dvec3(point.position_m), glm::dvec3(0.0, 0.0, 1.0), face), 0.02)
        << distance_m;
  }
  // The top of the cube sees none of it.
  EXPECT_EQ(view_of(casters, {.position_m = {1.0F, 0.0F, 2.0F}}).sky_frac, 1.0F);
}

TEST(SurfaceView, inside_a_body_all_rays_end_on_its_back_faces) {
  SurfaceScene scene;
  scene.add_static(test::box_mesh(glm::vec3(-1.0F), glm::vec3(1.0F)));
  const SurfaceView view =
      view_of(rays_through(scene), {.normal = glm::normalize(glm::vec3(1.0F, 2.0F, -0.5F))});
  EXPECT_EQ(view.sky_frac + view.far_frac, 0.0F);
  EXPECT_EQ(view.seen_count, SurfaceView::kMaxSeen);
  EXPECT_NEAR(total_frac(view), 1.0, 1e-5);
  for (std::size_t i = 0; i < view.seen_count; ++i) EXPECT_FALSE(view.seen[i].front);
}

TEST(SurfaceView, joined_hits_keep_objects_sides_and_places) {
  SurfaceScene scene;
  scene.add_static(ground());
  // Two rows of boxes stand left and right of the point, seen from 1 m above the ground.
  for (int i = 0; i < 8; ++i) {
    const auto y = static_cast<float>(i - 4);
    scene.add_static(test::box_mesh(glm::vec3(1.0F, y, 0.0F), glm::vec3(2.0F, y + 1.0F, 4.0F)));
  }
  const CasterRays casters = rays_through(scene);
  ViewPoint point{.position_m = {0.0F, 0.3F, 1.0F}, .normal = {1.0F, 0.0F, 0.0F}};
  const SurfaceView view = view_of(casters, point);
  EXPECT_EQ(view.seen_count, SurfaceView::kMaxSeen);
  EXPECT_NEAR(total_frac(view), 1.0, 1e-5);
  const glm::vec3 start = point.position_m + point.offset_m * point.normal;
  for (std::size_t i = 0; i < view.seen_count; ++i) {
    const SeenFace& seen = view.seen[i];
    const scene::Mesh& mesh = scene.geometry.meshes[seen.instance];
    const std::uint32_t* index = &mesh.indices[3 * std::size_t{seen.triangle}];
    const glm::vec3 place =
        (1.0F - seen.barycentric.x - seen.barycentric.y) * mesh.positions_m[index[0]] +
        seen.barycentric.x * mesh.positions_m[index[1]] +
        seen.barycentric.y * mesh.positions_m[index[2]];
    EXPECT_LT(glm::distance(place, start + seen.distance_m * seen.direction),
              2e-3F + 1e-5F * seen.distance_m);
  }
  // The face of each near box keeps its own share.
  for (std::uint32_t box = 4; box <= 6; ++box) {
    const double y = static_cast<double>(box) - 5.0;
    const std::array<glm::dvec3, 4> face = {glm::dvec3(1, y, 0), glm::dvec3(1, y + 1, 0),
                                            glm::dvec3(1, y + 1, 4), glm::dvec3(1, y, 4)};
    const double exact =
        polygon_frac(glm::dvec3(point.position_m), glm::dvec3(1.0, 0.0, 0.0), face);
    EXPECT_NEAR(instance_frac(view, box), exact, 0.02) << box;
  }
}

TEST(SurfaceView, an_entity_is_seen_where_it_stands) {
  SurfaceScene scene;
  scene.add_static(ground());
  const std::uint32_t entity =
      scene.add_entity(test::level_mesh(glm::vec3(-1e3F), glm::vec3(1e3F), 0.0F));
  const CasterRays casters = rays_through(scene);
  EntityPlacement placement{glm::mat3(1.0F), {0.0F, 0.0F, 1.0F}, true};
  const ViewSampler sampler(64);
  EXPECT_NEAR(instance_frac(sampler.view(casters, {}, {true, {&placement, 1}}), entity), 1.0, 1e-5);
  placement.on = false;
  EXPECT_EQ(sampler.view(casters, {}, {true, {&placement, 1}}).sky_frac, 1.0F);
}

}  // namespace
}  // namespace emit::renderer
