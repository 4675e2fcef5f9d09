// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>

namespace emit::reference {

/// Ray prepared for many triangles. The axes are permuted such that the largest component of the
/// direction is z, and a shear turns the ray into the z axis (Woop, Benthin, Wald 2013).
struct PreparedRay {
  glm::dvec3 origin_m{0.0};
  glm::dvec3 direction{0.0, 0.0, 1.0};
  int kx = 0;
  int ky = 1;
  int kz = 2;
  double shear_x = 0.0;
  double shear_y = 0.0;
  double scale_z = 1.0;
  /// Error bound of coordinates relative to the origin, m. A plane nearer than this counts as
  /// containing the origin.
  double plane_m = 0.0;

  PreparedRay() = default;
  PreparedRay(const glm::dvec3& origin_m, const glm::dvec3& direction, double plane_m) noexcept;
};

/// Hit of a ray on a triangle.
struct TriangleHit {
  double distance_m = 0.0;
  double u = 0.0;  ///< weight of the second vertex
  double v = 0.0;  ///< weight of the third vertex
};

/// Intersects a ray with a triangle. The test is watertight in the strict sense: no ray passes a
/// closed surface between its triangles, along an edge or through a vertex, because an exact sign
/// decides the side of each edge on points that neighbours share. Edges and vertices belong to all
/// their triangles.
/// Returns false if the ray misses, or if the triangle has no area, lies behind the origin or has
/// the origin in its plane.
[[nodiscard]] bool intersect(const PreparedRay& ray, const glm::dvec3& a_m, const glm::dvec3& b_m,
                             const glm::dvec3& c_m, TriangleHit& hit) noexcept;

/// Returns true if the plane of a triangle contains a point, to within `plane_m` and rounding.
/// intersect() ignores such a triangle.
[[nodiscard]] bool plane_holds(const glm::dvec3& point_m, double plane_m, const glm::dvec3& a_m,
                               const glm::dvec3& b_m, const glm::dvec3& c_m) noexcept;

}  // namespace emit::reference
