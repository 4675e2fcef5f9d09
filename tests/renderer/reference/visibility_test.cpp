// SPDX-License-Identifier: Apache-2.0
// Rays as the truth about visibility: no ray leaks, no surface shades itself, answers are the same
// anywhere in the world, and the error is known and falls with the number of rays.
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <limits>
#include <string>
#include <vector>

#include "emit/reference/sampling.hpp"
#include "emit/reference/sun_disc.hpp"
#include "renderer/reference/visibility_support.hpp"
#include "support/failed_check.hpp"

namespace emit {
namespace {

using reference::Ray;
using reference::RayMesh;
using reference::SurfacePoint;
using test::box_mesh;
using test::ground_mesh;
using test::make_scene;
using test::random_direction;
using test::sun_at;

class ClosedSurface : public testing::TestWithParam<glm::dvec3> {};
INSTANTIATE_TEST_SUITE_P(Places, ClosedSurface,
                         testing::Values(glm::dvec3(0.0), glm::dvec3(1e5, -1e5, 300.0),
                                         glm::dvec3(123456.789, 98765.4321, -1234.5678)));

TEST_P(ClosedSurface, IsNeverPassedAtEdgesAndVertices) {
  RayMesh mesh = test::sphere_mesh(1.7, 37, 53, 0.15);
  test::move(mesh, GetParam());
  const auto scene = make_scene({mesh});
  const auto now = scene.at(0);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> inside(-0.5, 0.5);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::size_t leaks = 0;
  std::size_t rays = 0;
  const auto shoot = [&](const glm::dvec3& from, const glm::dvec3& target, bool first) {
    const Ray ray{from, glm::normalize(target - from)};
    ++rays;
    if (!now.occluded(ray)) ++leaks;
    const auto hit = now.first_hit(ray);
    if (!hit) ++leaks;
    if (first && hit) {
      EXPECT_NEAR(hit->distance_m, glm::length(target - from), 1e-8);
    }
  };
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const glm::dvec3 from = GetParam() + glm::dvec3(inside(random), inside(random), inside(random));
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3& a = mesh.positions_m[mesh.indices[i + k]];
      const glm::dvec3& b = mesh.positions_m[mesh.indices[i + (k + 1) % 3]];
      shoot(from, a, false);
      shoot(from, 0.5 * (a + b), false);
      shoot(from, a + share(random) * (b - a), false);
      // A point in the middle sees everything, and it sees whole meridians edge-on.
      shoot(GetParam(), a, true);
    }
  }
  EXPECT_EQ(leaks, 0U) << "of " << rays;
}

TEST_P(ClosedSurface, DoesNotShadeItselfWhereConvex) {
  RayMesh mesh = test::sphere_mesh(2.3, 20, 30);
  test::move(mesh, GetParam());
  const auto scene = make_scene({mesh});
  const auto now = scene.at(0);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  for (std::uint32_t primitive = 0; primitive < mesh.indices.size() / 3; primitive += 3) {
    const auto t = now.triangle(0, primitive);
    const double u = share(random);
    const double v = share(random) * (1.0 - u);
    const glm::dvec3 normal = glm::normalize(glm::cross(t.b - t.a, t.c - t.a));
    const SurfacePoint point{.position_world_m = t.a + u * (t.b - t.a) + v * (t.c - t.a),
                             .normal = normal};
    const auto view = now.sky_view(point, 256);
    EXPECT_DOUBLE_EQ(view.sky_cosine.value_frac + view.ground_cosine.value_frac, 1.0);
    EXPECT_DOUBLE_EQ(view.sky_uniform.value_frac + view.ground_uniform.value_frac, 0.5);
    EXPECT_EQ(now.sun_visible_frac(point, normal).value_frac, 1.0);
    EXPECT_EQ(now.sun_visible_frac_clipped(point, normal).value_frac, 1.0);
  }
}

TEST(ReferenceVisibility, AllQueriesAreTheSameAHundredKilometresAway) {
  // Coordinates in 1/1024 m stay exact in double at 100 km. Every answer must therefore be the
  // same.
  const glm::dvec3 away{100000.0, -65536.0, 1024.0};
  std::vector<RayMesh> here{ground_mesh(64.0), box_mesh({-1.0, -0.5, 0.0}, {1.0, 0.5, 1.25})};
  std::vector<RayMesh> there = here;
  for (RayMesh& mesh : there) test::move(mesh, away);
  const auto scene_here = make_scene(here);
  const auto scene_there = make_scene(there);
  const auto now_here = scene_here.at(0);
  const auto now_there = scene_there.at(0);
  const glm::dvec3 to_sun = sun_at(200.0, 31.0);
  std::size_t penumbra = 0;
  for (int i = 0; i < 400; ++i) {
    const glm::dvec3 p{(i % 20 - 10) / 8.0 + 1.0 / 1024.0, 2.25 + (i / 20) / 64.0, 0.0};
    const SurfacePoint a{.position_world_m = p, .normal = {0.0, 0.0, 1.0}};
    const SurfacePoint b{.position_world_m = p + away, .normal = a.normal};
    const double f = now_here.sun_visible_frac_clipped(a, to_sun).value_frac;
    penumbra += f > 0.0 && f < 1.0 ? 1U : 0U;
    EXPECT_EQ(now_there.sun_visible_frac_clipped(b, to_sun).value_frac, f);
    EXPECT_EQ(now_there.sun_visible_frac(b, to_sun).value_frac,
              now_here.sun_visible_frac(a, to_sun).value_frac);
    if (i % 10 != 0) continue;
    EXPECT_EQ(now_there.sky_view(b, 1024).sky_cosine.value_frac,
              now_here.sky_view(a, 1024).sky_cosine.value_frac);
  }
  EXPECT_GT(penumbra, 3U);
}

TEST(ReferenceVisibility, TurningSceneAndSunTogetherChangesNothing) {
  const glm::dmat3 turn(glm::rotate(glm::dmat4(1.0), 37.0 * physics::kDegree,
                                    glm::normalize(glm::dvec3(0.0, 0.0, 1.0))));
  const glm::dmat3 tumble(glm::rotate(glm::dmat4(1.0), 71.0 * physics::kDegree,
                                      glm::normalize(glm::dvec3(1.0, 2.0, -0.7))));
  std::vector<RayMesh> meshes{ground_mesh(50.0), box_mesh({-1.0, -0.5, 0.0}, {1.0, 0.5, 1.25})};
  const auto upright = make_scene(meshes);
  std::vector<RayMesh> turned_meshes = meshes;
  std::vector<RayMesh> tumbled_meshes = meshes;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    for (auto& p : turned_meshes[m].positions_m) p = turn * p;
    for (auto& p : tumbled_meshes[m].positions_m) p = tumble * p;
  }
  const auto turned = make_scene(turned_meshes);
  const auto tumbled = make_scene(tumbled_meshes);
  const glm::dvec3 to_sun = sun_at(200.0, 31.0);
  for (int i = 0; i < 60; ++i) {
    const SurfacePoint point{.position_world_m = {0.3 + 0.01 * i, 0.6 + 0.03 * i, 0.0},
                             .normal = {0.0, 0.0, 1.0}};
    const SurfacePoint turned_point{.position_world_m = turn * point.position_world_m,
                                    .normal = turn * point.normal};
    const SurfacePoint tumbled_point{.position_world_m = tumble * point.position_world_m,
                                     .normal = tumble * point.normal};
    const double sun = upright.at(0).sun_visible_frac_clipped(point, to_sun).value_frac;
    EXPECT_NEAR(turned.at(0).sun_visible_frac_clipped(turned_point, turn * to_sun).value_frac, sun,
                1e-10);
    EXPECT_NEAR(tumbled.at(0).sun_visible_frac_clipped(tumbled_point, tumble * to_sun).value_frac,
                sun, 1e-10);
    // The open share of the hemisphere does not depend on which way is up.
    const auto a = upright.at(0).sky_view(point, 4096);
    const auto b = tumbled.at(0).sky_view(tumbled_point, 4096);
    EXPECT_NEAR(a.sky_cosine.value_frac + a.ground_cosine.value_frac,
                b.sky_cosine.value_frac + b.ground_cosine.value_frac, 4e-3);
    EXPECT_NEAR(turned.at(0).sky_view(turned_point, 4096).sky_uniform.value_frac,
                a.sky_uniform.value_frac, 2e-3);
  }
}

TEST(ReferenceVisibility, ErrorFallsWithTheNumberOfRaysAndStaysWithinItsEstimate) {
  // The sun's centre passes the edge of a wall at 45 degrees.
  const auto scene = make_scene({box_mesh({-2.0, -1000.0, 0.0}, {-1.0, 1000.0, 1.0})});
  const auto now = scene.at(0);
  double last_rms = 1.0;
  for (const std::uint32_t rays : {64U, 512U, 4096U, 32768U}) {
    double sum2 = 0.0;
    int outside = 0;
    constexpr int kEdges = 40;
    for (int i = 0; i < kEdges; ++i) {
      const double delta_deg = 0.2666 * (2.0 * (i + 0.5) / kEdges - 1.0);
      const glm::dvec3 to_sun = sun_at(270.0, 45.0 + delta_deg);
      const SurfacePoint point{};
      const double exact = now.sun_visible_frac_clipped(point, to_sun).value_frac;
      const auto sampled = now.sun_visible_frac(point, to_sun, {.rays = rays});
      const double error = std::abs(sampled.value_frac - exact);
      sum2 += error * error;
      outside += error > 3.0 * sampled.error_frac + 1.0 / rays ? 1 : 0;
    }
    const double rms = std::sqrt(sum2 / kEdges);
    EXPECT_LT(rms, 0.4 * last_rms) << rays;  // eight times the rays; random ones would give 0.35
    EXPECT_LE(outside, 2) << rays;
    last_rms = rms;
  }
  EXPECT_LT(last_rms, 2e-4);
}

TEST(ReferenceVisibility, IntegratedDiscAgreesWithRaysBehindRandomTriangles) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-0.006, 0.006);
  for (int trial = 0; trial < 30; ++trial) {
    RayMesh mesh;
    const std::uint32_t count = 1U + static_cast<std::uint32_t>(trial) * (trial > 26 ? 20U : 1U);
    for (std::uint32_t i = 0; i < 3 * count; ++i) {
      mesh.positions_m.emplace_back(place(random), place(random), 1.0 + 20.0 * place(random));
      mesh.indices.push_back(i);
    }
    const auto scene = make_scene({mesh});
    const glm::dvec3 to_sun{0.0, 0.0, 1.0};
    for (const double limb : {0.0, 0.6}) {
      const reference::SunQuery query{.rays = 16384, .limb_darkening_frac = limb};
      const auto rays = scene.at(0).sun_visible_frac({}, to_sun, query);
      const auto clipped = scene.at(0).sun_visible_frac_clipped({}, to_sun, query);
      EXPECT_NEAR(clipped.value_frac, rays.value_frac,
                  4.0 * rays.error_frac + clipped.error_frac + 2e-4)
          << count << " triangles, limb " << limb;
    }
  }
}

TEST(ReferenceVisibility, TangentPlaneCutsTheDisc) {
  const auto scene = make_scene({ground_mesh(10.0)});
  const SurfacePoint point{.normal = {0.0, 0.0, 1.0}};
  for (const double elevation_deg : {-0.3, -0.2, -0.05, 0.0, 0.1, 0.26, 0.3}) {
    const double v = std::clamp(elevation_deg / 0.2666, -1.0, 1.0);
    const double half_plane =
        // The planar approximation.
        0.5 + (std::asin(v) + v * std::sqrt(1.0 - v * v)) / physics::kPi;
    const glm::dvec3 to_sun = sun_at(77.0, elevation_deg);
    EXPECT_NEAR(scene.at(0).sun_visible_frac_clipped(point, to_sun).value_frac, half_plane, 5e-7);
    EXPECT_NEAR(scene.at(0).sun_visible_frac(point, to_sun, {.rays = 16384}).value_frac, half_plane,
                1e-3);
  }
}

TEST(ReferenceVisibility, CoincidentAndDegenerateTrianglesAreHarmless) {
  RayMesh mesh = ground_mesh(4.0);
  const auto nan = std::numeric_limits<double>::quiet_NaN();
  mesh.positions_m.insert(mesh.positions_m.end(),
                          {{0.0, 0.0, 0.0}, {nan, 0.0, 0.0}, {1e300, 0.0, 0.0}});
  // Add a triangle twice, a point, a line, and a triangle with NaN.
  mesh.indices.insert(mesh.indices.end(), {0, 1, 2, 0, 2, 3, 4, 4, 4, 0, 4, 2, 0, 1, 5});
  const auto scene = make_scene({mesh});
  EXPECT_EQ(scene.dropped_triangles(), 1U);
  EXPECT_EQ(scene.triangles(), 6U);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> place(-3.0, 3.0);
  for (int i = 0; i < 2000; ++i) {
    const glm::dvec3 above{place(random), place(random), 2.0};
    const auto hit = scene.at(0).first_hit({above, {0.0, 0.0, -1.0}});
    ASSERT_TRUE(hit.has_value());
    EXPECT_LT(hit->primitive, 2U);  // the first one of the coincident triangles
    EXPECT_NEAR(hit->distance_m, 2.0, 1e-12);
    // The doubled plane does not shade a point on it.
    EXPECT_FALSE(scene.at(0).occluded({{above.x, above.y, 0.0}, {0.6, 0.0, 0.8}}));
  }
}

TEST(ReferenceVisibility, HitTellsWhatIsHit) {
  RayMesh ground = ground_mesh(4.0);
  ground.materials = {7, 8};
  ground.object = 3;
  ground.instance = 11;
  ground.normals.assign(4, glm::normalize(glm::dvec3(0.1, 0.0, 1.0)));
  RayMesh box = box_mesh({-0.5, -0.5, 1.0}, {0.5, 0.5, 2.0});
  box.materials = {2};
  box.object = 4;
  const auto scene = make_scene({ground, box});
  const auto on_box = scene.at(0).first_hit({{0.1, 0.2, 5.0}, {0.0, 0.0, -1.0}});
  ASSERT_TRUE(on_box.has_value());
  EXPECT_EQ(on_box->object, 4U);
  EXPECT_EQ(on_box->material, 2U);
  EXPECT_TRUE(on_box->front);
  EXPECT_NEAR(on_box->position_world_m.z, 2.0, 1e-12);
  const auto on_ground = scene.at(0).first_hit({{2.0, -1.0, 5.0}, {0.0, 0.0, -1.0}});
  ASSERT_TRUE(on_ground.has_value());
  EXPECT_EQ(on_ground->object, 3U);
  EXPECT_EQ(on_ground->instance, 11U);
  EXPECT_EQ(on_ground->material, 7U);
  EXPECT_NEAR(on_ground->shading_normal.x, 0.1 / std::hypot(0.1, 1.0), 1e-12);
  EXPECT_EQ(on_ground->geometric_normal, glm::dvec3(0.0, 0.0, 1.0));
  const glm::dvec3 mixed =
      (1.0 - on_ground->barycentric.x - on_ground->barycentric.y) * ground.positions_m[0] +
      on_ground->barycentric.x * ground.positions_m[1] +
      on_ground->barycentric.y * ground.positions_m[2];
  EXPECT_NEAR(glm::distance(mixed, on_ground->position_world_m), 0.0, 1e-12);
  const auto from_below = scene.at(0).first_hit({{2.0, -1.0, -5.0}, {0.0, 0.0, 1.0}});
  ASSERT_TRUE(from_below.has_value());
  EXPECT_FALSE(from_below->front);
}

TEST(ReferenceVisibility, HemisphereAddsUpWithTheSkyView) {
  const auto scene = make_scene({ground_mesh(30.0), box_mesh({1.0, -3.0, 0.0}, {2.0, 3.0, 2.0})});
  const SurfacePoint wall{.position_world_m = {1.0, 0.3, 0.7}, .normal = {-1.0, 0.0, 0.0}};
  std::vector<reference::HemisphereRay> rays(8192);
  scene.at(0).hemisphere(wall, rays);
  std::size_t sky = 0;
  std::size_t ground = 0;
  for (const auto& ray : rays) {
    EXPECT_GT(glm::dot(ray.direction, wall.normal), 0.0);
    if (!ray.hit_surface) {
      sky += ray.direction.z > 0.0 ? 1U : 0U;
    } else {
      EXPECT_EQ(ray.hit.mesh, 0U);
      ++ground;
    }
  }
  const auto view = scene.at(0).sky_view(wall, 8192);
  EXPECT_NEAR(static_cast<double>(sky) / 8192.0, view.sky_cosine.value_frac, 1e-12);
  EXPECT_NEAR(view.sky_cosine.value_frac, 0.5, 1e-3);
  EXPECT_NEAR(static_cast<double>(ground) / 8192.0 + view.ground_cosine.value_frac, 0.5, 1e-3);
}

TEST(ReferenceVisibility, RefusesMeshesThatMakeNoSense) {
  RayMesh mesh = ground_mesh(1.0);
  mesh.indices[2] = 9;
  auto wrong = reference::RayScene::create({{mesh}, {}});
  ASSERT_FALSE(wrong.has_value());
  EXPECT_NE(wrong.error().text.find("mesh 0: index 9"), std::string::npos) << wrong.error().text;
  mesh = ground_mesh(1.0);
  mesh.entity = 0;
  EXPECT_FALSE(reference::RayScene::create({{mesh}, {}}).has_value());
  EXPECT_FALSE(reference::RayScene::create({{}, {reference::RayEntity{}}}).has_value());
  // A scene without geometry is valid: everything is open.
  const auto empty = make_scene({});
  EXPECT_EQ(empty.at(0).sky_view({.normal = {0.0, 0.0, 1.0}}, 64).sky_cosine.value_frac, 1.0);
}

TEST(ReferenceSampling, SequenceIsStratifiedInEveryElementaryRectangle) {
  for (const std::uint32_t seed : {0U, 1U, 12345U}) {
    for (std::uint32_t columns = 1; columns <= 1024; columns *= 2) {
      const std::uint32_t rows = 1024 / columns;
      std::vector<int> count(1024, 0);
      for (std::uint32_t i = 0; i < 1024; ++i) {
        const auto p = reference::sobol_owen_2d(3 * 1024 + i, seed);
        const auto column = static_cast<std::size_t>(p.x * columns);
        const auto row = static_cast<std::size_t>(p.y * rows);
        ++count[row * columns + column];
      }
      for (const int n : count) ASSERT_EQ(n, 1) << "seed " << seed << ", " << columns << " columns";
    }
  }
}

TEST(ReferenceSampling, DirectionsHaveTheirMoments) {
  const glm::dvec3 axis = glm::normalize(glm::dvec3(-0.3, 0.5, -0.8));
  const auto tangents = reference::tangents_of(axis);
  const double semi_rad = 0.4;
  double cap = 0.0;
  double cosine = 0.0;
  constexpr std::uint32_t kRays = 16384;
  for (std::uint32_t i = 0; i < kRays; ++i) {
    const auto disc = reference::disc_from_square(reference::sobol_owen_2d(i, 3));
    const auto d = reference::cap_direction(disc, axis, tangents, semi_rad);
    const auto c = reference::cosine_direction(disc, axis, tangents);
    EXPECT_NEAR(glm::length(d), 1.0, 1e-14);
    EXPECT_NEAR(glm::length(c), 1.0, 1e-14);
    EXPECT_GT(glm::dot(d, axis), std::cos(semi_rad) - 1e-12);
    cap += glm::dot(d, axis);
    cosine += glm::dot(c, axis);
  }
  EXPECT_NEAR(cap / kRays, 0.5 * (1.0 + std::cos(semi_rad)), 1e-6);
  EXPECT_NEAR(cosine / kRays, 2.0 / 3.0, 1e-4);
}

TEST(Visibility, QueriesAgainstTheContractStopTheProgram) {
  const auto scene = make_scene({ground_mesh(10.0)});
  const auto now = scene.at(0);
  const auto message_of = [](const auto& query) { return test::failed_check(query); };
  std::vector<reference::HemisphereRay> rays(4);
  EXPECT_NE(message_of([&] { now.hemisphere({}, rays); }).find("point.normal"), std::string::npos);
  const std::vector<SurfacePoint> points(3);
  std::vector<std::uint8_t> blocked(2);
  EXPECT_NE(message_of([&] {
              now.occluded(points, {0.0, 0.0, 1.0}, blocked);
            }).find("(3 == 2)"),
            std::string::npos);
  std::vector<double> seen(4);
  EXPECT_NE(message_of([&] {
              now.sun_visible_frac(points, {0.0, 0.0, 1.0}, {}, false, seen);
            }).find("(3 == 4)"),
            std::string::npos);
  EXPECT_NE(message_of([&] { (void)now.entity_pose(0); }).find("(0 < 0)"), std::string::npos);
  EXPECT_NE(message_of([&] { (void)now.triangle(0, 2); }).find("(2 < 2)"), std::string::npos);
  EXPECT_NE(message_of([&] { (void)now.triangle(1, 0); }).find("(1 < 1)"), std::string::npos);
}

}  // namespace
}  // namespace emit
