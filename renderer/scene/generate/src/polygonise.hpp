// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <vector>

namespace emit::scenegen {

/// Function that gives the distance to a surface, m; it is negative inside. It may overestimate by
/// at most the factor kMaxSlope.
class SignedDistance {
 public:
  virtual ~SignedDistance() = default;
  [[nodiscard]] virtual double at(const glm::dvec3& point_m) const noexcept = 0;
};
inline constexpr double kMaxSlope = 2.0;

/// Triangle mesh of a surface.
struct Surface {
  std::vector<glm::dvec3> positions_m;
  std::vector<std::uint32_t> indices;  ///< counter-clockwise from outside
};

/// Returns the surface of a shape by marching tetrahedra on a body-centred cubic lattice of the
/// given cell edge. The result is closed, manifold and without triangles of zero area as long as
/// the surface lies inside the box. Cells are visited along a space-filling curve, so that
/// neighbouring triangles are near each other in the list.
/// @pre cell_m > 0
[[nodiscard]] Surface polygonise(const SignedDistance& shape, const glm::dvec3& min_m,
                                 const glm::dvec3& max_m, double cell_m);

/// Returns unit normals of the vertices, weighted by area.
[[nodiscard]] std::vector<glm::dvec3> smooth_normals(const Surface& surface);

}  // namespace emit::scenegen
