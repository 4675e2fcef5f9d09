// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>

namespace emit::reference {

/// A ray prepared for many triangles: axes permuted so that the largest component of the direction
/// is z, and the shear that turns the ray into the z axis (Woop, Benthin, Wald 2013).
struct PreparedRay {
  glm::dvec3 origin_m{0.0};
  glm::dvec3 direction{0.0, 0.0, 1.0};
  int kx = 0;
  int ky = 1;
  int kz = 2;
  double shear_x = 0.0;
  double shear_y = 0.0;
  double scale_z = 1.0;
  /// Error bound of coordinates relative to the origin, metres: a plane nearer than this is taken
  /// to hold the origin.
  double plane_m = 0.0;

  PreparedRay() = default;
  PreparedRay(const glm::dvec3& origin_m, const glm::dvec3& direction, double plane_m) noexcept;
};

struct TriangleHit {
  double distance_m = 0.0;
  double u = 0.0;  ///< weight of the second vertex
  double v = 0.0;  ///< weight of the third
};

/// Watertight in the strict sense: a closed surface is never passed between its triangles, along an
/// edge or through a vertex, because the side of each edge is decided by an exact sign on points
/// that neighbours share. Edges and vertices belong to all their triangles. False as well for a
/// triangle without area, behind the origin or whose plane holds the origin.
[[nodiscard]] bool intersect(const PreparedRay& ray, const glm::dvec3& a_m, const glm::dvec3& b_m,
                             const glm::dvec3& c_m, TriangleHit& hit) noexcept;

/// The rule for the triangle's plane alone.
[[nodiscard]] bool plane_holds(const glm::dvec3& point_m, double plane_m, const glm::dvec3& a_m,
                               const glm::dvec3& b_m, const glm::dvec3& c_m) noexcept;

}  // namespace emit::reference
