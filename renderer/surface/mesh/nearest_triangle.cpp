// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/nearest_triangle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace emit::renderer {
namespace {

/// Share of the way along a-b that is nearest to p.
float along(const glm::vec3& a, const glm::vec3& b, const glm::vec3& p) noexcept {
  const glm::vec3 way = b - a;
  const float length2 = glm::dot(way, way);
  return length2 > 0.0F ? std::clamp(glm::dot(p - a, way) / length2, 0.0F, 1.0F) : 0.0F;
}

}  // namespace

glm::vec3 nearest_weight(const std::array<glm::vec3, 3>& c, const glm::vec3& p) noexcept {
  const glm::vec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
  const float area2 = glm::dot(normal, normal);
  if (area2 > 0.0F) {
    const glm::vec3 weight(glm::dot(glm::cross(c[1] - p, c[2] - p), normal) / area2,
                           glm::dot(glm::cross(c[2] - p, c[0] - p), normal) / area2,
                           glm::dot(glm::cross(c[0] - p, c[1] - p), normal) / area2);
    if (weight.x >= 0.0F && weight.y >= 0.0F && weight.z >= 0.0F) return weight;
  }
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
  triangles_.resize(indices.size() / 3);
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
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.radius_m = std::max(triangle.radius_m, glm::distance(c[k], triangle.centre_m));
      triangle.longest_m = std::max(triangle.longest_m, glm::distance(c[k], c[(k + 1) % 3]));
    }
  }
}

NearestTriangle::Hit NearestTriangle::find(const glm::vec3& point_m,
                                           const glm::vec3& normal) const {
  Hit best;
  best.distance_m = std::numeric_limits<float>::infinity();
  float best_facing = -2.0F;
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    const Triangle& triangle = triangles_[t];
    // As near as each other, but for rounding.
    const float slack_m = 1e-4F * triangle.longest_m;
    const float least_m = glm::distance(point_m, triangle.centre_m) - triangle.radius_m;
    if (least_m > best.distance_m + slack_m) continue;
    const glm::vec3 weight = nearest_weight(triangle.corner_m, point_m);
    glm::vec3 there_m(0.0F);
    for (glm::length_t k = 0; k < 3; ++k) {
      there_m += weight[k] * triangle.corner_m[static_cast<std::size_t>(k)];
    }
    const float distance_m = glm::distance(point_m, there_m);
    const float facing = glm::dot(triangle.normal, normal);
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
