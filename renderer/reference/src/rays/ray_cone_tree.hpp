// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::reference {

/// Box hierarchy that answers which triangles may lie within a cone: what stands between a point
/// and the sun's disc. Boxes in float32, rounded outwards.
class ConeTree {
 public:
  ConeTree() = default;
  explicit ConeTree(std::span<const std::array<glm::dvec3, 3>> triangles);

  /// Appends the triangles whose boxes may touch the cone, in no order.
  void query(const glm::dvec3& apex_m, const glm::dvec3& axis, double semi_angle_rad,
             std::vector<std::uint32_t>& out) const;

 private:
  struct Node {
    glm::vec3 low_m;
    glm::vec3 high_m;
    std::uint32_t first = 0;  ///< leaf: first entry of order_; inner: index of the second child
    std::uint32_t count = 0;  ///< 0: inner, its first child follows
  };
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace emit::reference
