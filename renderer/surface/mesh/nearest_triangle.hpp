// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

namespace emit::renderer {

/// Returns the weights of a triangle's corners at its point nearest to p. That is the foot of the
/// perpendicular if it lies inside, else the nearest point of an edge. Weights are >= 0 and add up
/// to 1.
[[nodiscard]] glm::vec3 nearest_weight(const std::array<glm::vec3, 3>& corner_m,
                                       const glm::vec3& p_m) noexcept;

/// Search for the nearest of up to some thousand triangles. Immutable after construction; find()
/// may run on many threads. Setup only.
class NearestTriangle {
 public:
  /// Result of find().
  struct Hit {
    std::uint32_t triangle = 0;
    float distance_m = 0.0F;
    glm::vec3 weight{0.0F};  ///< weights of the corners at the nearest point; >= 0, add up to 1
  };
  /// Copies the triangles, three indices each.
  /// @pre at least one triangle
  NearestTriangle(std::span<const glm::vec3> positions_m, std::span<const std::uint32_t> indices);

  /// Returns the nearest triangle. If several are equally near, it is the one that faces most like
  /// `normal` (unit length).
  [[nodiscard]] Hit find(const glm::vec3& point_m, const glm::vec3& normal) const;
  /// Returns the length of the longest edge of a triangle.
  [[nodiscard]] float longest_edge_m(std::uint32_t triangle) const noexcept {
    return triangles_[triangle].longest_m;
  }

 private:
  /// Triangle with what find() needs of it.
  struct Triangle {
    std::array<glm::vec3, 3> corner_m;
    glm::vec3 normal{0.0F};
    glm::vec3 centre_m{0.0F};
    float longest_m = 0.0F;
  };
  /// Returns the distance from a triangle, exact except for rounding.
  [[nodiscard]] float distance_m(std::uint32_t triangle, const glm::vec3& point_m) const noexcept;

  std::vector<Triangle> triangles_;
  std::vector<glm::vec4> balls_m_;  ///< by triangle; centre and radius of a ball that holds it
  float longest_m_ = 0.0F;          ///< longest of all edges
};

}  // namespace emit::renderer
