// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::reference {

/// Hierarchy of boxes that finds the triangles which may lie within a cone. The cone holds what
/// stands between a point and the sun's disc. Boxes are float32, rounded outwards.
class ConeTree {
 public:
  ConeTree() = default;
  explicit ConeTree(std::span<const std::array<glm::dvec3, 3>> triangles);

  /// Appends the indices of the triangles whose boxes may touch the cone, in no order. The cone has
  /// its apex at `apex_m` and opens by `semi_angle_rad` around the unit vector `axis`.
  void query(const glm::dvec3& apex_m, const glm::dvec3& axis, double semi_angle_rad,
             std::vector<std::uint32_t>& out) const;

 private:
  struct Node {
    glm::vec3 low_m;
    glm::vec3 high_m;
    /// First entry of order_ (leaf), or index of the second child (inner node).
    std::uint32_t first = 0;
    std::uint32_t count = 0;  ///< 0 marks an inner node, whose first child follows it
  };
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace emit::reference
