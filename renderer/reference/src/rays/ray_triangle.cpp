// SPDX-License-Identifier: Apache-2.0
#include "ray_triangle.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace emit::reference {
namespace {

constexpr double kRoundoff = 0.5 * std::numeric_limits<double>::epsilon();

/// Returns a b - c d with the right sign. The result is zero only if the exact value is zero
/// (barring underflow).
double exact_sign_difference(double a, double b, double c, double d) noexcept {
  const double p = a * b;
  const double q = c * d;
  const double difference = p - q;
  if (std::abs(difference) > 4.0 * kRoundoff * (std::abs(p) + std::abs(q))) return difference;
  // The products are close, so p - q is exact (Sterbenz). Get the rounding errors of the products,
  // which are exact too.
  const double p_rest = std::fma(a, b, -p);
  const double q_rest = std::fma(c, d, -q);
  const double rest = q_rest - p_rest;
  if (difference != rest) return difference - rest;
  // They are equal after rounding of `rest`. Let the part that this rounding lost decide.
  const double back = rest + p_rest;
  const double lost = (q_rest - back) + ((back - rest) - p_rest);
  return -lost;
}

/// Returns the largest absolute component.
double largest(const glm::dvec3& v) noexcept {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// Returns true if the origin lies in the plane of a triangle, to within `plane_m` and rounding.
bool plane_holds_origin(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
                        double plane_m) noexcept {
  const glm::dvec3 ab = b - a;
  const glm::dvec3 ac = c - a;
  const glm::dvec3 normal = glm::cross(ab, ac);
  const double reach_m = std::min({largest(a), largest(b), largest(c)});
  // Allow for the rounding of the normal. For a thin triangle it grows with the sides, not with the
  // area.
  const double slack = plane_m * glm::length(normal) +
                       16.0 * kRoundoff * reach_m * glm::length(ab) * glm::length(ac);
  // Measure from the nearest corner: the product loses least there.
  const glm::dvec3& nearest = largest(a) <= largest(b) ? (largest(a) <= largest(c) ? a : c)
                                                       : (largest(b) <= largest(c) ? b : c);
  return std::abs(glm::dot(normal, nearest)) <= slack;
}

}  // namespace

PreparedRay::PreparedRay(const glm::dvec3& origin, const glm::dvec3& towards, double plane) noexcept
    : origin_m(origin), direction(towards), plane_m(plane) {
  // Make the largest component of the direction z, and keep the frame right-handed.
  const glm::dvec3 size = glm::abs(direction);
  kz = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
  kx = (kz + 1) % 3;
  ky = (kx + 1) % 3;
  if (direction[kz] < 0.0) std::swap(kx, ky);
  shear_x = direction[kx] / direction[kz];
  shear_y = direction[ky] / direction[kz];
  scale_z = 1.0 / direction[kz];
}

bool plane_holds(const glm::dvec3& point_m, double plane_m, const glm::dvec3& a_m,
                 const glm::dvec3& b_m, const glm::dvec3& c_m) noexcept {
  return plane_holds_origin(a_m - point_m, b_m - point_m, c_m - point_m, plane_m);
}

bool intersect(const PreparedRay& ray, const glm::dvec3& a_m, const glm::dvec3& b_m,
               const glm::dvec3& c_m, TriangleHit& hit) noexcept {
  // Move to the origin of the ray and shear, so that the ray becomes the z axis.
  const glm::dvec3 a = a_m - ray.origin_m;
  const glm::dvec3 b = b_m - ray.origin_m;
  const glm::dvec3 c = c_m - ray.origin_m;
  const double ax = a[ray.kx] - ray.shear_x * a[ray.kz];
  const double ay = a[ray.ky] - ray.shear_y * a[ray.kz];
  const double bx = b[ray.kx] - ray.shear_x * b[ray.kz];
  const double by = b[ray.ky] - ray.shear_y * b[ray.kz];
  const double cx = c[ray.kx] - ray.shear_x * c[ray.kz];
  const double cy = c[ray.ky] - ray.shear_y * c[ray.kz];
  // Compute the edge functions with exact signs. The ray passes inside if no two have opposite
  // signs.
  const double u = exact_sign_difference(cx, by, cy, bx);
  const double v = exact_sign_difference(ax, cy, ay, cx);
  const double w = exact_sign_difference(bx, ay, by, ax);
  if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return false;
  const double determinant = u + v + w;
  if (determinant == 0.0) return false;
  // Interpolate the distance and reject hits behind the origin.
  const double share_a = u / determinant;
  const double share_b = v / determinant;
  const double share_c = w / determinant;
  const double distance_m =
      ray.scale_z * (share_a * a[ray.kz] + share_b * b[ray.kz] + share_c * c[ray.kz]);
  if (!(distance_m > 0.0)) return false;
  // Ignore a triangle whose plane contains the origin: it is the point's own surface.
  if (plane_holds_origin(a, b, c, ray.plane_m)) return false;
  hit = {distance_m, share_b, share_c};
  return true;
}

}  // namespace emit::reference
