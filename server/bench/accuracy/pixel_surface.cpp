// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/pixel_surface.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::tool {
namespace {

/// Smallest step in depth beyond the tangent plane, in footprints of a pixel.
constexpr double kStepPx = 3.0;

}  // namespace

double pixel_rad(const reference::SolveView& view) noexcept {
  return 2.0 * std::tan(0.5 * view.fov_h_rad) / view.width_px;
}

PixelSurface trace_pixel(const reference::SceneInstant& scene, const reference::SolveView& view,
                         std::uint32_t column, std::uint32_t row) {
  const double scale = pixel_rad(view);
  const glm::dvec3 body(1.0, scale * (column + 0.5 - 0.5 * view.width_px),
                        scale * (row + 0.5 - 0.5 * view.height_px));
  const glm::dvec3 direction =
      glm::normalize(view.sensor_pose.world_from_body * glm::normalize(body));
  const auto hit = scene.first_hit({view.sensor_pose.position_world_m, direction, 0.0});
  PixelSurface pixel;
  if (!hit) return pixel;
  pixel.surface = true;
  pixel.object = hit->object;
  pixel.material = hit->material;
  pixel.entity = hit->entity;
  pixel.distance_m = hit->distance_m;
  pixel.position_m = hit->position_world_m;
  pixel.normal = hit->front ? hit->geometric_normal : -hit->geometric_normal;
  pixel.shading_normal = hit->front ? hit->shading_normal : -hit->shading_normal;
  if (glm::dot(pixel.shading_normal, pixel.normal) <= 0.0) pixel.shading_normal = pixel.normal;
  return pixel;
}

bool is_outline(const PixelSurface& a, const PixelSurface& b, double width_rad) noexcept {
  if (a.surface != b.surface) return true;
  if (!a.surface) return false;
  if (a.object != b.object) return true;
  // The step is measured along either normal. The normal of a surface that turns away from the eye
  // is nearly square to the way to the surface behind it.
  const glm::dvec3 way_m = b.position_m - a.position_m;
  const double step_m =
      std::max(std::abs(glm::dot(way_m, a.normal)), std::abs(glm::dot(way_m, b.normal)));
  return step_m > kStepPx * width_rad * std::min(a.distance_m, b.distance_m);
}

}  // namespace emit::tool
