// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/nearest_triangle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Share of the longest edge below which a difference of distances is rounding. Such triangles
/// count as equally near.
constexpr float kSlackFrac = 1e-4F;
/// Number of such slacks behind the nearest triangle within which others may still be chosen.
constexpr float kFarSlacks = 16.0F;

/// Returns the share of the way from a to b at the point nearest to p, 0 to 1.
float along(const glm::vec3& a, const glm::vec3& b, const glm::vec3& p) noexcept {
  const glm::vec3 way = b - a;
  const float length2 = glm::dot(way, way);
  return length2 > 0.0F ? std::clamp(glm::dot(p - a, way) / length2, 0.0F, 1.0F) : 0.0F;
}

}  // namespace

glm::vec3 nearest_weight(const std::array<glm::vec3, 3>& c, const glm::vec3& p) noexcept {
  // Try the foot of the perpendicular first: signed areas of the three parts are its weights.
  const glm::vec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
  const float area2 = glm::dot(normal, normal);
  if (area2 > 0.0F) {
    const glm::vec3 weight(glm::dot(glm::cross(c[1] - p, c[2] - p), normal) / area2,
                           glm::dot(glm::cross(c[2] - p, c[0] - p), normal) / area2,
                           glm::dot(glm::cross(c[0] - p, c[1] - p), normal) / area2);
    if (weight.x >= 0.0F && weight.y >= 0.0F && weight.z >= 0.0F) return weight;
  }
  // Take the nearest point of the three edges if the foot lies outside or the triangle has no area.
  glm::vec3 best(1.0F, 0.0F, 0.0F);
  float best_m = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t next = (i + 1) % 3;
    const float t = along(c[i], c[next], p);
    const float distance_m = glm::distance(p, glm::mix(c[i], c[next], t));
    if (distance_m < best_m) {
      best_m = distance_m;
      best = glm::vec3(0.0F);
      best[static_cast<glm::length_t>(i)] = 1.0F - t;
      best[static_cast<glm::length_t>(next)] = t;
    }
  }
  return best;
}

NearestTriangle::NearestTriangle(std::span<const glm::vec3> positions_m,
                                 std::span<const std::uint32_t> indices) {
  EMIT_CHECK_OP(indices.size(), >=, 3U);
  triangles_.resize(indices.size() / 3);
  balls_m_.resize(triangles_.size());
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    Triangle& triangle = triangles_[t];
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.corner_m[k] = positions_m[indices[3 * t + k]];
      triangle.centre_m += triangle.corner_m[k] / 3.0F;
    }
    const std::array<glm::vec3, 3>& c = triangle.corner_m;
    const glm::vec3 across = glm::cross(c[1] - c[0], c[2] - c[0]);
    const float area = glm::length(across);
    if (area > 0.0F) triangle.normal = across / area;
    // Bound the triangle by a ball around its centre.
    float radius_m = 0.0F;
    for (std::size_t k = 0; k < 3; ++k) {
      radius_m = std::max(radius_m, glm::distance(c[k], triangle.centre_m));
      triangle.longest_m = std::max(triangle.longest_m, glm::distance(c[k], c[(k + 1) % 3]));
    }
    balls_m_[t] = glm::vec4(triangle.centre_m, radius_m);
    longest_m_ = std::max(longest_m_, triangle.longest_m);
  }
}

float NearestTriangle::distance_m(std::uint32_t triangle, const glm::vec3& point_m) const noexcept {
  const std::array<glm::vec3, 3>& corner_m = triangles_[triangle].corner_m;
  const glm::vec3 weight = nearest_weight(corner_m, point_m);
  return glm::distance(point_m,
                       weight.x * corner_m[0] + weight.y * corner_m[1] + weight.z * corner_m[2]);
}

NearestTriangle::Hit NearestTriangle::find(const glm::vec3& point_m,
                                           const glm::vec3& normal) const {
  // Find the ball with the nearest centre: its triangle limits how far away the nearest one can be.
  std::uint32_t likely = 0;
  float least_m2 = std::numeric_limits<float>::infinity();
  for (std::uint32_t t = 0; t < balls_m_.size(); ++t) {
    const glm::vec3 way_m = glm::vec3(balls_m_[t]) - point_m;
    const float way_m2 = glm::dot(way_m, way_m);
    if (way_m2 < least_m2) {
      least_m2 = way_m2;
      likely = t;
    }
  }
  const float bound_m = distance_m(likely, point_m) + kFarSlacks * kSlackFrac * longest_m_;
  // Measure the triangles whose balls come as near as that.
  Hit best;
  best.distance_m = std::numeric_limits<float>::infinity();
  float best_facing = -2.0F;
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    const glm::vec3 way_m = glm::vec3(balls_m_[t]) - point_m;
    const float reach_m = bound_m + balls_m_[t].w;
    if (glm::dot(way_m, way_m) > reach_m * reach_m) continue;
    const Triangle& triangle = triangles_[t];
    const float slack_m = kSlackFrac * triangle.longest_m;
    const glm::vec3 weight = nearest_weight(triangle.corner_m, point_m);
    glm::vec3 there_m(0.0F);
    for (glm::length_t k = 0; k < 3; ++k) {
      there_m += weight[k] * triangle.corner_m[static_cast<std::size_t>(k)];
    }
    const float distance_m = glm::distance(point_m, there_m);
    const float facing = glm::dot(triangle.normal, normal);
    // Take a triangle that is clearly nearer, or equally near and better aligned.
    const bool nearer = distance_m < best.distance_m - slack_m;
    const bool as_near = distance_m <= best.distance_m + slack_m;
    if (nearer || (as_near && facing > best_facing)) {
      best = {t, std::min(distance_m, best.distance_m), weight};
      if (nearer) best.distance_m = distance_m;
      best_facing = facing;
    }
  }
  return best;
}

}  // namespace emit::renderer
