// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/interval_rays.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <vector>

#include "emit/physics/constants.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

constexpr float kPlateM = 3.0F;
constexpr float kOffsetM = 5e-4F;
constexpr std::int64_t kNoonNs = 4 * 3'600'000'000'000;  // about 10:45 local solar time

scene::ScenarioDesc place() {
  scene::ScenarioDesc s;
  s.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  s.epoch_utc_ns = 1'403'330'400'000'000'000;  // 2014-06-21 06:00 UTC
  return s;
}

/// A level plate 3 m above the ground whose edge runs north-south above x = 0; it lies in the east.
class IntervalRaysTest : public ::testing::Test {
 protected:
  IntervalRaysTest() : environment_(place()) {
    test::SurfaceScene scene;
    scene.add_static(scene.add_mesh(test::level_mesh(glm::vec3(0.0F, -200.0F, 0.0F),
                                                     glm::vec3(200.0F, 200.0F, 0.0F), kPlateM)),
                     glm::dmat4(1.0));
    auto rays = CasterRays::create(scene.geometry);
    EXPECT_TRUE(rays.has_value());
    rays_.emplace(std::move(*rays));
  }
  [[nodiscard]] SurfaceSample ground_at(double x_m) const {
    SurfaceSample sample;
    sample.position_m = glm::vec3(glm::dvec3(x_m, 0.0, 0.0) - rays_->origin_world_m());
    sample.normal = glm::vec3(0.0F, 0.0F, 1.0F);
    return sample;
  }
  void update(std::int64_t begin_ns, std::int64_t end_ns) {
    interval_.update(begin_ns, end_ns, 3, environment_, EntityPoses({}), rays_->origin_world_m());
  }
  /// Returns the visible share of a uniform disc behind the edge.
  [[nodiscard]] double expected_frac(double x_m, std::int64_t now_ns) const {
    const glm::dvec3 sun = environment_.sun_at(now_ns).direction_enu;
    const glm::dvec3 to_edge = glm::normalize(glm::dvec3(-x_m, 0.0, kPlateM));
    const glm::dvec3 plane = glm::cross(glm::dvec3(0.0, 1.0, 0.0), to_edge);
    const double v =
        std::clamp(-std::asin(glm::dot(plane, sun)) / physics::kSunSemiAngleRad, -1.0, 1.0);
    return 0.5 + (std::asin(v) + v * std::sqrt(1.0 - v * v)) / physics::kPi;
  }
  /// Returns the place of the middle of the shadow's edge.
  [[nodiscard]] double edge_m(std::int64_t now_ns) const {
    const glm::dvec3 sun = environment_.sun_at(now_ns).direction_enu;
    return -kPlateM * sun.x / sun.z;
  }

  Environment environment_;
  std::optional<CasterRays> rays_;
  IntervalRays interval_{std::vector<float>{}};
};

TEST_F(IntervalRaysTest, PenumbraIsThatOfTheSunsDisc) {
  update(kNoonNs, kNoonNs);
  ASSERT_TRUE(interval_.sun_up());
  const double middle_m = edge_m(kNoonNs);
  for (double x_m = middle_m - 0.05; x_m < middle_m + 0.05; x_m += 0.002) {
    EXPECT_NEAR(interval_.sun_frac(*rays_, ground_at(x_m), kOffsetM, 0.0F),
                expected_frac(x_m, kNoonNs), 0.05)
        << x_m;
  }
  EXPECT_EQ(interval_.sun_frac(*rays_, ground_at(middle_m - 0.5), kOffsetM, 0.0F), 1.0F);
  EXPECT_EQ(interval_.sun_frac(*rays_, ground_at(middle_m + 0.5), kOffsetM, 0.0F), 0.0F);
}

TEST_F(IntervalRaysTest, AShadowIsNoShorterThanItsCaster) {
  // The point lies 3 cm above the ground, where a start half a millimetre above it would show.
  constexpr float kLowM = 0.03F;
  test::SurfaceScene scene;
  scene.add_static(scene.add_mesh(test::level_mesh(glm::vec3(0.0F, -20.0F, 0.0F),
                                                   glm::vec3(20.0F, 20.0F, 0.0F), kLowM)),
                   glm::dmat4(1.0));
  const auto rays = CasterRays::create(scene.geometry);
  ASSERT_TRUE(rays.has_value());
  interval_.update(kNoonNs, kNoonNs, 3, environment_, EntityPoses({}), rays->origin_world_m());
  const glm::dvec3 sun = environment_.sun_at(kNoonNs).direction_enu;
  const double middle_m = -kLowM * sun.x / sun.z;
  ASSERT_GT(std::abs(middle_m), 0.3 * kLowM);
  double lit_m = 0.0;  // of two millimetres around the edge
  constexpr int kPlaces = 400;
  for (int i = 0; i < kPlaces; ++i) {
    const double x_m = middle_m + 2e-3 * ((i + 0.5) / kPlaces - 0.5);
    SurfaceSample sample;
    sample.position_m = glm::vec3(glm::dvec3(x_m, 0.0, 0.0) - rays->origin_world_m());
    sample.normal = glm::vec3(0.0F, 0.0F, 1.0F);
    lit_m += 2e-3 / kPlaces * interval_.sun_frac(*rays, sample, RayOffsets().sun_m, 0.0F);
  }
  EXPECT_NEAR(lit_m, 1e-3, 5e-5);
}

TEST_F(IntervalRaysTest, AnIntervalSeesTheMeanWhileTheEdgeMovesOver) {
  const std::int64_t end_ns = kNoonNs + 1'800'000'000'000;
  update(kNoonNs, end_ns);
  const double from_m = std::min(edge_m(kNoonNs), edge_m(end_ns));
  const double to_m = std::max(edge_m(kNoonNs), edge_m(end_ns));
  for (int i = 1; i < 10; ++i) {
    const double x_m = from_m + 0.1 * i * (to_m - from_m);
    double mean_frac = 0.0;
    constexpr int kInstants = 400;
    for (int k = 0; k < kInstants; ++k) {
      const auto at_ns = kNoonNs + (end_ns - kNoonNs) * (2 * k + 1) / (2 * kInstants);
      mean_frac += expected_frac(x_m, at_ns) / kInstants;
    }
    EXPECT_NEAR(interval_.sun_frac(*rays_, ground_at(x_m), kOffsetM, 0.0F), mean_frac, 0.05);
  }
}

TEST_F(IntervalRaysTest, BlurSpreadsTheEdgeAsANormalDistribution) {
  update(kNoonNs, kNoonNs);
  const double middle_m = edge_m(kNoonNs);
  const float sigma_m = 0.2F;
  for (const double z : {-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5}) {
    const double expected = 0.5 * std::erfc(z / std::sqrt(2.0));
    // A first packet of 16 that agrees ends the search: a tail of 1/15 may be missed.
    const auto sample = ground_at(middle_m + z * static_cast<double>(sigma_m));
    EXPECT_NEAR(interval_.sun_frac(*rays_, sample, kOffsetM, sigma_m), expected, 0.08) << z;
  }
}

TEST_F(IntervalRaysTest, NothingIsTracedAtNightOrBehindTheFace) {
  update(16 * 3'600'000'000'000, 16 * 3'600'000'000'000);
  EXPECT_FALSE(interval_.sun_up());
  EXPECT_EQ(interval_.sun_frac(*rays_, ground_at(-5.0), kOffsetM, 0.0F), 0.0F);
  update(kNoonNs, kNoonNs);
  SurfaceSample down = ground_at(-5.0);
  down.normal = glm::vec3(0.0F, 0.0F, -1.0F);
  EXPECT_EQ(interval_.sun_frac(*rays_, down, kOffsetM, 0.0F), 0.0F);
}

TEST_F(IntervalRaysTest, ABodyThatPassesHidesTheSunForTheTimeItTakes) {
  test::SurfaceScene scene;
  scene.add_static(scene.add_mesh(test::level_mesh(glm::vec3(-90.0F, -90.0F, 0.0F),
                                                   glm::vec3(90.0F, 90.0F, 0.0F), -1.0F)),
                   glm::dmat4(1.0));
  constexpr double kHalfLengthM = 3.0;
  scene.add_entity(test::box_mesh(glm::vec3(-kHalfLengthM, -2.0F, -0.01F),
                                  glm::vec3(kHalfLengthM, 2.0F, 0.01F)));
  const auto rays = CasterRays::create(scene.geometry);
  ASSERT_TRUE(rays.has_value());
  constexpr double kIntervalS = 20.0;
  const auto end_ns = kNoonNs + std::llround(kIntervalS * 1e9);
  const glm::dvec3 sun = environment_.sun_at((kNoonNs + end_ns) / 2).direction_enu;
  IntervalRays interval(std::vector<float>{4.0F});
  // The entity stands between the sun and the place in the middle of the interval, 5 m above the
  // ground.
  const glm::dvec3 between_m = 5.0 / sun.z * sun + glm::dvec3(0.0, 0.0, -1.0);
  for (const double speed_m_s : {0.8, 1.0, 2.0, 4.0, 16.0}) {
    std::vector<PoseHistory> entities;
    entities.emplace_back(scene::ObjectDesc{}, physics::Pose{});
    for (const double side : {-1.0, 1.0}) {
      physics::Pose pose;
      pose.position_world_m = between_m + glm::dvec3(side * 0.5 * kIntervalS * speed_m_s, 0.0, 0.0);
      ASSERT_TRUE(entities[0].append(side < 0.0 ? kNoonNs : end_ns, pose, true, false));
    }
    const double shaded_frac = 2.0 * kHalfLengthM / speed_m_s / kIntervalS;
    // The entity hides the sun wherever its way lies in the interval, as long as it passes wholly.
    const double aside_m = 0.5 * (kIntervalS * speed_m_s - 2.0 * kHalfLengthM) - 0.2;
    for (std::uint32_t turn = 0; turn < 4; ++turn) {
      interval.update(kNoonNs, end_ns, turn, environment_, EntityPoses(entities),
                      rays->origin_world_m());
      for (int k = -5; k <= 5; ++k) {
        SurfaceSample sample;
        sample.position_m =
            glm::vec3(glm::dvec3(0.2 * k * aside_m, 0.0, -1.0) - rays->origin_world_m());
        sample.normal = glm::vec3(0.0F, 0.0F, 1.0F);
        const double found_frac = 1.0 - interval.sun_frac(*rays, sample, kOffsetM, 0.0F);
        EXPECT_LT(found_frac, shaded_frac + 2.5 / kSunRays) << speed_m_s << " m/s, " << k;
        EXPECT_GT(found_frac, shaded_frac - 2.5 / kSunRays) << speed_m_s << " m/s, " << k;
      }
    }
  }
}

/// Entities that no ray of a packet can meet are ignored. An exaggerated radius makes every ray
/// test them.
TEST_F(IntervalRaysTest, WhatIsPassedOverWouldNotHaveHiddenTheSun) {
  test::SurfaceScene scene;
  scene.add_static(scene.add_mesh(test::level_mesh(glm::vec3(-900.0F, -900.0F, 0.0F),
                                                   glm::vec3(900.0F, 900.0F, 0.0F), -1.0F)),
                   glm::dmat4(1.0));
  for (int i = 0; i < 2; ++i) {
    scene.add_entity(test::box_mesh(glm::vec3(-2.0F, -1.0F, -1.5F), glm::vec3(2.0F, 1.0F, 1.5F)));
  }
  const auto rays = CasterRays::create(scene.geometry);
  ASSERT_TRUE(rays.has_value());
  // One crosses the field, one stands high above it and vanishes half-way.
  std::vector<PoseHistory> entities;
  for (int i = 0; i < 2; ++i) entities.emplace_back(scene::ObjectDesc{}, physics::Pose{});
  const std::int64_t end_ns = kNoonNs + 60'000'000'000;
  for (int k = 0; k <= 60; ++k) {
    const std::int64_t at_ns = kNoonNs + std::int64_t{k} * 1'000'000'000;
    const glm::dvec3 on_the_way(-30.0 + k, 5.0 * std::sin(0.2 * k), 2.0);
    ASSERT_TRUE(
        entities[0].append(at_ns, {on_the_way, physics::Pose{}.world_from_body}, true, false));
    ASSERT_TRUE(entities[1].append(at_ns, {{0.0, 0.0, 150.0}, physics::Pose{}.world_from_body},
                                   k < 30, false));
  }
  IntervalRays tight(std::vector<float>{2.7F, 2.7F});
  IntervalRays wide(std::vector<float>{1e6F, 1e6F});
  int partly = 0;
  for (const std::int64_t begin_ns : {kNoonNs, kNoonNs + 20'000'000'000}) {
    tight.update(begin_ns, end_ns, 3, environment_, EntityPoses(entities), rays->origin_world_m());
    wide.update(begin_ns, end_ns, 3, environment_, EntityPoses(entities), rays->origin_world_m());
    for (int y = -40; y <= 160; y += 2) {
      for (int x = -60; x <= 60; x += 2) {
        SurfaceSample sample;
        sample.position_m = glm::vec3(glm::dvec3(x, y, -1.0) - rays->origin_world_m());
        sample.normal = glm::vec3(0.0F, 0.0F, 1.0F);
        const float found = tight.sun_frac(*rays, sample, kOffsetM, 0.3F);
        ASSERT_EQ(found, wide.sun_frac(*rays, sample, kOffsetM, 0.3F)) << x << ' ' << y;
        partly += found > 0.0F && found < 1.0F ? 1 : 0;
      }
    }
  }
  EXPECT_GT(partly, 100);
  // The sky is tested wherever the entity passes, here within five metres of it.
  IntervalRays near(std::vector<float>{0.5F, 0.5F});
  near.update(kNoonNs, end_ns, 3, environment_, EntityPoses(entities), rays->origin_world_m());
  std::array<float, 3> hidden_on_third{};
  for (int k = 0; k < 60; ++k) {
    SurfaceSample sample;
    const glm::dvec3 beside(-30.0 + k, 5.0 * std::sin(0.2 * k), -1.0);
    sample.position_m = glm::vec3(beside - rays->origin_world_m());
    sample.normal = glm::vec3(0.0F, 0.0F, 1.0F);
    hidden_on_third[static_cast<std::size_t>(k) / 20] +=
        near.hidden_sky(*rays, sample, kOffsetM).frac;
    sample.position_m.y += 100.0F;
    EXPECT_EQ(near.hidden_sky(*rays, sample, kOffsetM).frac, 0.0F) << k;
  }
  for (const float hidden : hidden_on_third) EXPECT_GT(hidden, 0.2F);
}

/// A wide plate over a face hides all of its sky, however the face is tilted.
TEST_F(IntervalRaysTest, ARoofHidesTheWholeSkyOfTiltedFaces) {
  constexpr float kHalfM = 100.0F;
  test::SurfaceScene scene;
  scene.add_entity(
      test::level_mesh(glm::vec3(-kHalfM, -kHalfM, 0.0F), glm::vec3(kHalfM, kHalfM, 0.0F), 0.0F));
  auto rays = CasterRays::create(scene.geometry, rays_->origin_world_m());
  ASSERT_TRUE(rays.has_value());
  std::vector<PoseHistory> entities;
  entities.emplace_back(scene::ObjectDesc{}, physics::Pose{});
  ASSERT_TRUE(entities[0].append(kNoonNs, physics::Pose{}, true, false));
  for (const SkyMeasure measure : {SkyMeasure::cosine, SkyMeasure::sphere}) {
    IntervalRays under(std::vector<float>{1.5F * kHalfM}, measure);
    under.update(kNoonNs, kNoonNs, 3, environment_, EntityPoses(entities), rays->origin_world_m());
    for (const double tilt_deg : {0.0, 30.0, 60.0, 90.0, 120.0}) {
      const auto tilt_rad = static_cast<float>(tilt_deg * physics::kDegree);
      SurfaceSample sample;
      sample.position_m = glm::vec3(glm::dvec3(0.0, 0.0, -0.5) - rays->origin_world_m());
      sample.normal = glm::vec3(std::sin(tilt_rad), 0.0F, std::cos(tilt_rad));
      EXPECT_EQ(under.hidden_sky(*rays, sample, kOffsetM).frac, 1.0F) << tilt_deg;
    }
  }
}

}  // namespace
}  // namespace emit::renderer
