// SPDX-License-Identifier: Apache-2.0
#include "draw/sky_bodies.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/constants.hpp"

namespace emit::renderer {
namespace {

constexpr float kEvenDiscPx = 2.0F;
constexpr float kDiscPoints = 32.0F;
constexpr float kStraightDiscPx = 16.0F;

/// Middle and radius of a disc in the image; the radius is 0 out of view.
struct ImageDisc {
  glm::vec2 at_px{0.0F};
  float radius_px = 0.0F;
};

ImageDisc image_disc(const glm::dvec3& towards_world, double semi_angle_rad,
                     const gpu::FrameParams& params) noexcept {
  ImageDisc disc;
  const glm::dmat3 sensor_from_relworld =
      glm::transpose(glm::dmat3(glm::mat3(params.relworld_from_sensor)));
  const glm::dvec3 ray = sensor_from_relworld * towards_world;
  if (towards_world.z <= 0.0 || ray.z <= 0.0) return disc;
  const glm::dvec2 tangent = glm::dvec2(ray) / ray.z;
  const glm::dvec2 per_px(params.ray_per_px);
  const glm::dvec2 at_px = (tangent - glm::dvec2(params.ray_at_corner)) / per_px;
  // A pixel away from the boresight has a smaller solid angle; the disc keeps its own.
  const double stretch = std::pow(1.0 + glm::dot(tangent, tangent), 0.75);
  const double radius_px = semi_angle_rad * stretch / std::sqrt(std::abs(per_px.x * per_px.y));
  const glm::dvec2 size_px(params.rendered_px);
  const glm::dvec2 nearest = glm::clamp(at_px, glm::dvec2(0.0), size_px);
  if (!(glm::distance(at_px, nearest) < radius_px)) return disc;
  disc.at_px = glm::vec2(at_px);
  disc.radius_px = static_cast<float>(radius_px);
  return disc;
}

float half_plane_frac(float distance, glm::vec2 normal) noexcept {
  const float larger = std::max(std::abs(normal.x), std::abs(normal.y));
  const float smaller = std::min(std::abs(normal.x), std::abs(normal.y));
  const float beyond = std::max(0.5F * (larger + smaller) - std::abs(distance), 0.0F);
  const float tip = 0.5F * beyond * beyond / std::max(larger * smaller, 1e-12F);
  const float covered = std::abs(distance) <= 0.5F * (larger - smaller)
                            ? 0.5F + std::abs(distance) / larger
                            : 1.0F - tip;
  return distance < 0.0F ? 1.0F - covered : covered;
}

int disc_side(float radius) noexcept {
  return radius < kEvenDiscPx ? 16 : std::clamp(static_cast<int>(kDiscPoints / radius), 2, 16);
}

glm::vec3 disc_point(int i, int side, glm::vec2 centre, float radius) noexcept {
  if (radius < kEvenDiscPx) {
    const float share = (static_cast<float>(i) + 0.5F) / static_cast<float>(side * side);
    const float angle = 2.39996323F * static_cast<float>(i);
    return {std::sqrt(share) * glm::vec2(std::cos(angle), std::sin(angle)), 1.0F};
  }
  const glm::vec2 place(static_cast<float>(i % side), static_cast<float>(i / side));
  const glm::vec2 point = ((place + 0.5F) / static_cast<float>(side) - 0.5F - centre) / radius;
  const float away = glm::length(point);
  return away < 1.0F ? glm::vec3(point, 1.0F) : glm::vec3(point * (0.99F / away), 1e-6F);
}

}  // namespace

void set_sky_bodies(const physics::SunPosition& sun, const physics::MoonPosition& moon,
                    gpu::FrameParams& params) noexcept {
  const ImageDisc sun_disc =
      image_disc(sun.direction_enu, physics::kSunSemiAngleRad / sun.distance_au, params);
  params.sun_at_px = sun_disc.at_px;
  params.sun_radius_px = sun_disc.radius_px;
  const ImageDisc moon_disc =
      image_disc(moon.direction_enu, std::asin(physics::kMoonRadiusM / moon.distance_m), params);
  params.moon_at_px = moon_disc.at_px;
  params.moon_radius_px = moon_disc.radius_px;
  params.moon_sun_au = static_cast<float>(moon.sun_au);
  // The disc's own axes: along the image's columns and rows across the line of sight, and back to
  // the camera.
  const glm::dmat3 relworld_from_sensor(glm::mat3(params.relworld_from_sensor));
  const glm::dvec3 towards = moon.direction_enu;
  const glm::dvec3 down = glm::normalize(relworld_from_sensor[1] -
                                         glm::dot(relworld_from_sensor[1], towards) * towards);
  const glm::dvec3 right = glm::cross(down, towards);
  params.moon_to_sun = glm::vec3(glm::dot(moon.to_sun_enu, right), glm::dot(moon.to_sun_enu, down),
                                 -glm::dot(moon.to_sun_enu, towards));
}

float disc_cover_frac(glm::vec2 centre_px, float radius_px) noexcept {
  const float away = glm::length(centre_px);
  if (away > radius_px + 0.7072F) return 0.0F;
  if (away < radius_px - 0.7072F) return 1.0F;
  if (radius_px > kStraightDiscPx) return half_plane_frac(radius_px - away, -centre_px / away);
  const float first = std::asin(std::clamp((-0.5F - centre_px.x) / radius_px, -1.0F, 1.0F));
  const float last = std::asin(std::clamp((0.5F - centre_px.x) / radius_px, -1.0F, 1.0F));
  float sum = 0.0F;
  for (int i = 0; i < 16; ++i) {
    const float angle = std::lerp(first, last, (static_cast<float>(i) + 0.5F) / 16.0F);
    const float half_chord = radius_px * std::cos(angle);
    sum += std::max(
               std::min(0.5F, centre_px.y + half_chord) - std::max(-0.5F, centre_px.y - half_chord),
               0.0F) *
           half_chord;
  }
  return std::clamp(sum * (last - first) / 16.0F, 0.0F, 1.0F);
}

SkyBodies sky_bodies_at(glm::ivec2 px, const gpu::FrameParams& params) noexcept {
  SkyBodies out;
  const glm::vec2 middle = glm::vec2(px) + 0.5F;
  if (params.moon_radius_px > 0.0F) {
    const glm::vec2 centre = params.moon_at_px - middle;
    out.moon_frac = disc_cover_frac(centre, params.moon_radius_px);
    const int side = disc_side(params.moon_radius_px);
    out.moon_points = static_cast<std::size_t>(side * side);
    for (std::size_t i = 0; i < out.moon_points; ++i) {
      const glm::vec3 sample = disc_point(static_cast<int>(i), side, centre, params.moon_radius_px);
      const glm::vec2 point(sample);
      const glm::vec3 normal(point, std::sqrt(std::max(1.0F - glm::dot(point, point), 0.0F)));
      out.moon_weight[i] = sample.z;
      out.moon_cosine[i] = std::max(glm::dot(normal, params.moon_to_sun), 0.0F);
      out.moon_k[i] =
          static_cast<float>(physics::moon_temperature_k(out.moon_cosine[i], params.moon_sun_au));
    }
  }
  if (params.sun_radius_px > 0.0F) {
    out.sun_frac =
        disc_cover_frac(params.sun_at_px - middle, params.sun_radius_px) * (1.0F - out.moon_frac);
  }
  return out;
}

}  // namespace emit::renderer
