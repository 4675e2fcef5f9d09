// SPDX-License-Identifier: Apache-2.0
// Entities cast the shadow of their pose at the instant asked for, and answers do not depend on how
// work is split.
#include <tbb/global_control.h>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/frames.hpp"
#include "renderer/reference/visibility_support.hpp"
#include "support/times.hpp"

namespace emit {
namespace {

using reference::RayEntity;
using reference::RayMesh;
using reference::SurfacePoint;
using test::box_mesh;
using test::ground_mesh;
using test::make_scene;
using test::sun_at;

using emit::test::kSecondNs;

/// Returns a level box that drives east at 1 m/s from `start`. The box is in body axes (x forward,
/// z down).
RayEntity driving_east(const glm::dvec3& start) {
  const glm::dquat east = physics::world_from_body_heading_pitch_roll(0.5 * physics::kPi, 0.0, 0.0);
  RayEntity entity{.entity_id = 5};
  entity.poses.push_back({.sim_time_ns = 0, .pose = {start, east}});
  entity.poses.push_back(
      {.sim_time_ns = 10 * kSecondNs, .pose = {start + glm::dvec3(10.0, 0.0, 0.0), east}});
  entity.poses.push_back({.sim_time_ns = 20 * kSecondNs,
                          .pose = {start + glm::dvec3(10.0, 0.0, 0.0), east},
                          .on = false});
  return entity;
}

class Entities : public testing::TestWithParam<glm::dvec3> {};
INSTANTIATE_TEST_SUITE_P(Places, Entities,
                         testing::Values(glm::dvec3(0.0), glm::dvec3(1e5, -1e5, 512.0)));

TEST_P(Entities, ShadeWhereTheyStoodAtTheInstant) {
  RayMesh ground = ground_mesh(50.0);
  test::move(ground, GetParam());
  RayMesh body = box_mesh({-2.0, -1.0, -1.5}, {2.0, 1.0, -0.5});
  body.entity = 0;
  body.object = 1;
  const auto scene = make_scene({ground, body}, {driving_east(GetParam())});
  const auto up = [&](double east_m, std::int64_t time_ns) {
    const SurfacePoint point{.position_world_m = GetParam() + glm::dvec3(east_m, 0.25, 0.0),
                             .normal = {0.0, 0.0, 1.0}};
    const auto now = scene.at(time_ns);
    const double rays = now.sun_visible_frac(point, {0.0, 0.0, 1.0}).value_frac;
    EXPECT_NEAR(now.sun_visible_frac_clipped(point, {0.0, 0.0, 1.0}).value_frac, rays, 5e-3);
    return rays;
  };
  EXPECT_EQ(up(0.0, 0), 0.0);
  EXPECT_EQ(up(5.0, 0), 1.0);
  EXPECT_EQ(up(0.0, 5 * kSecondNs), 1.0);
  EXPECT_EQ(up(5.0, 5 * kSecondNs), 0.0);
  EXPECT_NEAR(up(5.0, 3 * kSecondNs), 0.5, 5e-3);  // the front edge is right overhead
  EXPECT_EQ(up(10.0, 15 * kSecondNs), 0.0);        // the box is parked
  EXPECT_EQ(up(10.0, 20 * kSecondNs), 1.0);        // the box is switched off
  EXPECT_FALSE(scene.at(20 * kSecondNs).entity_on(0));

  const auto hit =
      scene.at(4 * kSecondNs).first_hit({GetParam() + glm::dvec3(4.5, 0.25, 0.0), {0.0, 0.0, 1.0}});
  ASSERT_TRUE(hit.has_value());
  EXPECT_EQ(hit->entity, 0U);
  EXPECT_EQ(hit->object, 1U);
  EXPECT_NEAR(hit->distance_m, 0.5, 1e-9);
  EXPECT_NEAR(hit->geometric_normal.z, -1.0, 1e-12);  // the underside was hit
}

TEST_P(Entities, DoNotShadeTheirOwnOutside) {
  RayMesh body = box_mesh({-2.0, -1.0, -1.5}, {2.0, 1.0, -0.5});
  body.entity = 0;
  const auto scene = make_scene({body}, {driving_east(GetParam())});
  for (int second = 0; second < 10; ++second) {
    const auto now = scene.at(second * kSecondNs + 123'456'789);
    const glm::dvec3 roof_body{0.7 - 0.1 * second, 0.3, -1.5};
    const auto& pose = now.entity_pose(0);
    const SurfacePoint roof{.position_world_m = pose.position_world_m +
                                                glm::mat3_cast(pose.world_from_body) * roof_body,
                            .normal = {0.0, 0.0, 1.0}};
    EXPECT_EQ(now.sky_view(roof, 512).sky_cosine.value_frac, 1.0);
    EXPECT_EQ(now.sun_visible_frac(roof, sun_at(100.0, 20.0)).value_frac, 1.0);
    EXPECT_EQ(now.sun_visible_frac_clipped(roof, sun_at(100.0, 20.0)).value_frac, 1.0);
  }
}

std::vector<SurfacePoint> ground_points() {
  std::vector<SurfacePoint> points;
  for (int i = 0; i < 3000; ++i) {
    points.push_back({.position_world_m = {-6.0 + 0.2 * (i % 60), -5.0 + 0.2 * (i / 60), 0.0},
                      .normal = {0.0, 0.0, 1.0}});
  }
  return points;
}

TEST(ReferenceVisibilityThreads, AnswersDoNotDependOnTheirNumber) {
  RayMesh body = test::sphere_mesh(1.2, 12, 20, 0.2);
  body.entity = 0;
  const auto scene =
      make_scene({ground_mesh(20.0), box_mesh({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0})}, {});
  const auto moving =
      make_scene({ground_mesh(20.0), body}, {driving_east(glm::dvec3(-3.0, 0.0, 1.0))});
  const auto points = ground_points();
  for (const auto* tested : {&scene, &moving}) {
    const auto now = tested->at(2 * kSecondNs);
    std::vector<std::vector<double>> shares;
    std::vector<std::vector<std::uint8_t>> blocked;
    for (const std::size_t threads : {1U, 2U, 5U}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      shares.emplace_back(points.size());
      now.sun_visible_frac(points, sun_at(135.0, 25.0), {.rays = 32}, false, shares.back());
      blocked.emplace_back(points.size());
      now.occluded(points, sun_at(135.0, 25.0), blocked.back());
    }
    EXPECT_EQ(shares[0], shares[1]);
    EXPECT_EQ(shares[0], shares[2]);
    EXPECT_EQ(blocked[0], blocked[1]);
    EXPECT_EQ(blocked[0], blocked[2]);
    std::size_t dark = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(blocked[0][i] != 0,
                now.occluded({points[i].position_world_m, sun_at(135.0, 25.0)}));
      dark += blocked[0][i];
    }
    EXPECT_GT(dark, 50U);
    EXPECT_LT(dark, points.size() - 50U);
  }
}

TEST(ReferenceVisibilityFast, Float32AgreesAwayFromEdges) {
  const std::vector<RayMesh> meshes{ground_mesh(20.0),
                                    box_mesh({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0})};
  const auto exact = make_scene(meshes);
  const auto fast = make_scene(meshes, {}, reference::RayArithmetic::fast);
  const auto points = ground_points();
  std::vector<std::uint8_t> a(points.size());
  std::vector<std::uint8_t> b(points.size());
  exact.at(0).occluded(points, sun_at(135.0, 25.0), a);
  fast.at(0).occluded(points, sun_at(135.0, 25.0), b);
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different += a[i] != b[i] ? 1U : 0U;
  EXPECT_LT(different, a.size() / 100);
}

}  // namespace
}  // namespace emit
