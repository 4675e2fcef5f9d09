// SPDX-License-Identifier: Apache-2.0
// Discs in the image: shares of pixels against their area, sizes against solid angles.
#include "draw/sky_bodies.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>

#include "draw/camera_setup.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"

namespace emit::renderer {
namespace {

TEST(SkyDisc, shares_of_all_pixels_sum_to_the_area) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> phase(0.0F, 1.0F);
  for (const float radius : {0.02F, 0.1F, 0.4F, 0.9F, 3.0F, 11.0F, 15.9F, 16.1F, 60.0F}) {
    for (int i = 0; i < 50; ++i) {
      const glm::vec2 at(phase(random), phase(random));
      const int reach = static_cast<int>(radius) + 2;
      double sum = 0.0;
      for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
          const float share = disc_cover_frac(at - glm::vec2(x, y), radius);
          EXPECT_GE(share, 0.0F);
          EXPECT_LE(share, 1.0F);
          sum += share;
        }
      }
      const double area = std::numbers::pi * radius * radius;
      EXPECT_NEAR(sum, area, 0.004 * area) << radius;
    }
  }
}

TEST(SkyDisc, shares_of_single_pixels_are_those_of_points_in_them) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> offset(-0.8F, 0.8F);
  for (const float radius : {0.3F, 0.8F, 4.0F, 30.0F, 300.0F}) {
    for (int i = 0; i < 40; ++i) {
      const float angle = 6.2831853F * static_cast<float>(i) / 40.0F;
      const glm::vec2 centre =
          (radius + offset(random)) * glm::vec2(std::cos(angle), std::sin(angle));
      constexpr int kSide = 200;
      int inside = 0;
      for (int p = 0; p < kSide * kSide; ++p) {
        const glm::vec2 point((static_cast<float>(p % kSide) + 0.5F) / kSide - 0.5F,
                              (static_cast<float>(p / kSide) + 0.5F) / kSide - 0.5F);
        inside += glm::length(point - centre) < radius ? 1 : 0;
      }
      EXPECT_NEAR(disc_cover_frac(centre, radius), inside / static_cast<double>(kSide * kSide),
                  0.012)
          << radius << ' ' << i;
    }
  }
}

/// Camera at a heading and pitch.
gpu::FrameParams camera(double fov_h_rad, double heading_rad, double pitch_rad) {
  scene::SensorDesc sensor;
  sensor.width_px = 640;
  sensor.height_px = 512;
  gpu::FrameParams params{};
  params.rendered_px = {640, 512};
  const physics::Pose pose{
      {0.0, 0.0, 100.0}, physics::world_from_body_heading_pitch_roll(heading_rad, pitch_rad, 0.3)};
  static_cast<void>(set_camera(sensor, fov_h_rad, pose, params));
  return params;
}

glm::dvec3 towards(double heading_rad, double elevation_rad) {
  return {std::sin(heading_rad) * std::cos(elevation_rad),
          std::cos(heading_rad) * std::cos(elevation_rad), std::sin(elevation_rad)};
}

TEST(SkyDisc, has_the_solid_angle_of_the_body_anywhere_in_the_image) {
  physics::SunPosition sun;
  sun.direction_enu = towards(1.0, 0.5);
  sun.distance_au = 1.01;
  const double half_rad = physics::kSunSemiAngleRad / 1.01;
  const double solid_angle_sr = 2.0 * std::numbers::pi * (1.0 - std::cos(half_rad));
  physics::MoonPosition moon;
  moon.direction_enu = {0.0, 0.0, -1.0};
  for (const double fov_rad : {0.02, 0.3, 1.8}) {
    for (const double off : {0.0, 0.2, 0.42}) {
      const gpu::FrameParams params =
          camera(fov_rad, 1.0 + off * fov_rad, 0.5 - 0.3 * off * fov_rad);
      ASSERT_GT(params.rendered_px.x, 0U);
      gpu::FrameParams set = params;
      set_sky_bodies(sun, moon, set);
      ASSERT_GT(set.sun_radius_px, 0.0F);
      EXPECT_EQ(set.moon_radius_px, 0.0F);
      // Sum the shares over the solid angles of the pixels; a small disc may end at the image's
      // edge.
      double sum_sr = 0.0;
      bool cut = false;
      const int reach = static_cast<int>(set.sun_radius_px) + 2;
      const glm::ivec2 middle(set.sun_at_px);
      for (int y = middle.y - reach; y <= middle.y + reach; ++y) {
        for (int x = middle.x - reach; x <= middle.x + reach; ++x) {
          cut = cut || x < 0 || y < 0 || x >= 640 || y >= 512;
          const glm::dvec2 tangent =
              (glm::dvec2(x, y) + 0.5) * glm::dvec2(set.ray_per_px) + glm::dvec2(set.ray_at_corner);
          sum_sr += sky_bodies_at({x, y}, set).sun_frac * set.ray_per_px.x * set.ray_per_px.y *
                    std::pow(1.0 + glm::dot(tangent, tangent), -1.5);
        }
      }
      EXPECT_NEAR(sum_sr, solid_angle_sr, 0.006 * solid_angle_sr) << fov_rad << ' ' << off << cut;
    }
  }
}

TEST(SkyDisc, is_skipped_out_of_view_behind_the_camera_and_below_the_horizon) {
  physics::MoonPosition moon;
  moon.direction_enu = towards(1.0, 0.5);
  physics::SunPosition sun;
  for (const auto& [heading, elevation, seen] :
       {std::tuple{1.0, 0.5, true}, std::tuple{1.3, 0.5, false},
        std::tuple{1.0 + 3.14159, 0.5, false}, std::tuple{1.0 + 3.14159, -0.5, false}}) {
    gpu::FrameParams params = camera(0.2, heading, elevation);
    sun.direction_enu = towards(1.0, 0.5);
    set_sky_bodies(sun, moon, params);
    EXPECT_EQ(params.sun_radius_px > 0.0F, seen) << heading << ' ' << elevation;
    EXPECT_EQ(params.moon_radius_px > 0.0F, seen);
  }
  gpu::FrameParams params = camera(0.2, 1.0, -0.01);
  sun.direction_enu = towards(1.0, -0.01);
  set_sky_bodies(sun, moon, params);
  EXPECT_EQ(params.sun_radius_px, 0.0F);
}

TEST(SkyDisc, the_lit_side_of_the_moon_is_that_of_the_sun) {
  physics::SunPosition sun;
  sun.direction_enu = {0.0, 0.0, -1.0};
  physics::MoonPosition moon;
  moon.direction_enu = towards(1.0, 0.5);
  for (const double turn : {0.0, 1.0, 2.5, 4.0}) {
    gpu::FrameParams params = camera(0.02, 1.0, 0.5);
    // A half moon: the sun stands to a side, at an angle in the image.
    const glm::dmat3 from_sensor(glm::mat3(params.relworld_from_sensor));
    moon.to_sun_enu = std::cos(turn) * from_sensor[0] + std::sin(turn) * from_sensor[1];
    set_sky_bodies(sun, moon, params);
    ASSERT_GT(params.moon_radius_px, 50.0F);
    glm::dvec2 lit(0.0);
    for (int y = 0; y < 512; ++y) {
      for (int x = 0; x < 640; ++x) {
        const SkyBodies bodies = sky_bodies_at({x, y}, params);
        lit += static_cast<double>(bodies.moon_frac * bodies.moon_cosine[0]) *
               (glm::dvec2(x, y) + 0.5 - glm::dvec2(params.moon_at_px));
      }
    }
    const glm::dvec2 side = glm::normalize(lit);
    EXPECT_NEAR(side.x, std::cos(turn), 0.02);
    EXPECT_NEAR(side.y, std::sin(turn), 0.02);
  }
}

}  // namespace
}  // namespace emit::renderer
