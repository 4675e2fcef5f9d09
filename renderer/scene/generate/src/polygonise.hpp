// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <vector>

namespace emit::scenegen {

/// Distance to a surface, negative inside. May overestimate by at most the factor kMaxSlope.
class SignedDistance {
 public:
  virtual ~SignedDistance() = default;
  [[nodiscard]] virtual double at(const glm::dvec3& point_m) const noexcept = 0;
};
inline constexpr double kMaxSlope = 2.0;

struct Surface {
  std::vector<glm::dvec3> positions_m;
  std::vector<std::uint32_t> indices;  ///< counter-clockwise from outside
};

/// Marching tetrahedra on a body-centred cubic lattice of the given cell edge. The result is
/// closed, manifold and without zero-area triangles as long as the surface lies inside the box.
/// Cells are visited along a space-filling curve, so that triangles near each other are near in the
/// list.
[[nodiscard]] Surface polygonise(const SignedDistance& shape, const glm::dvec3& min_m,
                                 const glm::dvec3& max_m, double cell_m);

/// Area-weighted unit normals.
[[nodiscard]] std::vector<glm::dvec3> smooth_normals(const Surface& surface);

}  // namespace emit::scenegen
