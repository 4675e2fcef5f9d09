// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

namespace emit::renderer {

/// Weights of a triangle's corners at its point that is nearest to p: the foot of the perpendicular
/// if it lies inside, else the nearest point of an edge. >= 0, add up to 1.
[[nodiscard]] glm::vec3 nearest_weight(const std::array<glm::vec3, 3>& corner_m,
                                       const glm::vec3& p_m) noexcept;

/// Finds the nearest of up to some thousand triangles. Setup only; find() may run on many threads.
class NearestTriangle {
 public:
  struct Hit {
    std::uint32_t triangle = 0;
    float distance_m = 0.0F;
    glm::vec3 weight{0.0F};  ///< of its corners, at the nearest point; >= 0, add up to 1
  };
  /// @pre at least one triangle
  NearestTriangle(std::span<const glm::vec3> positions_m, std::span<const std::uint32_t> indices);

  /// Of triangles as near as each other the one that faces most like `normal`.
  [[nodiscard]] Hit find(const glm::vec3& point_m, const glm::vec3& normal) const;
  [[nodiscard]] float longest_edge_m(std::uint32_t triangle) const noexcept {
    return triangles_[triangle].longest_m;
  }

 private:
  struct Triangle {
    std::array<glm::vec3, 3> corner_m;
    glm::vec3 normal{0.0F};
    glm::vec3 centre_m{0.0F};
    float longest_m = 0.0F;
  };
  /// Distance from the triangle, exact but for rounding.
  [[nodiscard]] float distance_m(std::uint32_t triangle, const glm::vec3& point_m) const noexcept;

  std::vector<Triangle> triangles_;
  std::vector<glm::vec4> balls_m_;  ///< by triangle: centre and radius of a ball that holds it
  float longest_m_ = 0.0F;          ///< of all edges
};

}  // namespace emit::renderer
