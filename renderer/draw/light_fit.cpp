// SPDX-License-Identifier: Apache-2.0
#include "draw/light_fit.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Plane. A point p is inside when dot(normal, p) + offset_m >= 0.
struct Plane {
  glm::dvec3 normal;
  double offset_m;
};

/// Largest number of corners of a clipped face.
constexpr std::size_t kMaxPolygon = 16;
/// Convex polygon in fixed memory.
struct Polygon {
  std::array<glm::dvec3, kMaxPolygon> points;
  std::size_t count = 0;
  void add(const glm::dvec3& p) noexcept {
    if (count < kMaxPolygon) points[count++] = p;
  }
};

/// Largest number of corners of the visible volume: twelve faces, each a quad that grows by at most
/// one corner for each of six planes.
constexpr std::size_t kMaxPoints = 12 * 10;
/// Points in fixed memory, relworld metres.
struct Points {
  std::array<glm::dvec3, kMaxPoints> points;
  std::size_t count = 0;
};

/// Cuts off the part of a polygon that lies outside a plane.
void clip(Polygon& polygon, const Plane& plane) noexcept {
  Polygon out;
  for (std::size_t i = 0; i < polygon.count; ++i) {
    const glm::dvec3& a = polygon.points[i];
    const glm::dvec3& b = polygon.points[(i + 1) % polygon.count];
    const double da = glm::dot(plane.normal, a) + plane.offset_m;
    const double db = glm::dot(plane.normal, b) + plane.offset_m;
    if (da >= 0.0) out.add(a);
    if ((da >= 0.0) != (db >= 0.0)) out.add(a + (b - a) * (da / (da - db)));
  }
  polygon = out;
}

/// Planes of the view pyramid between two boresight distances.
std::array<Plane, 6> pyramid_planes(const ViewVolume& view, double near_m, double far_m) noexcept {
  const glm::dmat3& m = view.relworld_from_sensor;
  return {Plane{m * glm::dvec3(1.0, 0.0, view.tan_half_h), 0.0},
          Plane{m * glm::dvec3(-1.0, 0.0, view.tan_half_h), 0.0},
          Plane{m * glm::dvec3(0.0, 1.0, view.tan_half_v), 0.0},
          Plane{m * glm::dvec3(0.0, -1.0, view.tan_half_v), 0.0},
          Plane{m * glm::dvec3(0.0, 0.0, 1.0), -near_m},
          Plane{m * glm::dvec3(0.0, 0.0, -1.0), far_m}};
}

/// Corners of the view pyramid between two boresight distances, numbered by bits (x, y, z).
std::array<glm::dvec3, 8> pyramid_corners(const ViewVolume& view, double near_m,
                                          double far_m) noexcept {
  std::array<glm::dvec3, 8> corners;
  for (std::size_t i = 0; i < 8; ++i) {
    const double depth_m = (i & 4U) != 0 ? far_m : near_m;
    corners[i] = view.relworld_from_sensor *
                 glm::dvec3((i & 1U) != 0 ? view.tan_half_h : -view.tan_half_h,
                            (i & 2U) != 0 ? view.tan_half_v : -view.tan_half_v, 1.0) *
                 depth_m;
  }
  return corners;
}

/// Faces of a box whose corners are numbered by bits (x, y, z): two faces for each axis.
constexpr std::array<std::array<std::size_t, 4>, 6> kFaces = {
    {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}}};

/// Clips the six faces of a box by planes and appends the corners that are left.
void add_clipped_faces(const std::array<glm::dvec3, 8>& corners, std::span<const Plane> planes,
                       Points& out) noexcept {
  for (const auto& face : kFaces) {
    Polygon polygon;
    for (const std::size_t corner : face) polygon.add(corners[corner]);
    for (const Plane& plane : planes) clip(polygon, plane);
    for (std::size_t i = 0; i < polygon.count && out.count < kMaxPoints; ++i) {
      out.points[out.count++] = polygon.points[i];
    }
  }
}

/// Corners of the intersection of the scene's box with the view pyramid between two distances.
void visible_points(const ViewVolume& view, double near_m, double far_m, Points& out) noexcept {
  std::array<glm::dvec3, 8> box;
  for (std::size_t i = 0; i < 8; ++i) {
    box[i] = {(i & 1U) != 0 ? view.scene_max_m.x : view.scene_min_m.x,
              (i & 2U) != 0 ? view.scene_max_m.y : view.scene_min_m.y,
              (i & 4U) != 0 ? view.scene_max_m.z : view.scene_min_m.z};
  }
  // Clip the faces of each volume by the planes of the other.
  const std::array<Plane, 6> box_planes = {
      Plane{{1, 0, 0}, -view.scene_min_m.x}, Plane{{-1, 0, 0}, view.scene_max_m.x},
      Plane{{0, 1, 0}, -view.scene_min_m.y}, Plane{{0, -1, 0}, view.scene_max_m.y},
      Plane{{0, 0, 1}, -view.scene_min_m.z}, Plane{{0, 0, -1}, view.scene_max_m.z}};
  const auto pyramid = pyramid_planes(view, near_m, far_m);
  out.count = 0;
  add_clipped_faces(box, pyramid, out);
  add_clipped_faces(pyramid_corners(view, near_m, far_m), box_planes, out);
}

/// Light frustum with the rectangle of smallest area around the points, among those with a side
/// along one of 32 directions. The area is within 0.3 % of the true minimum for elongated shapes,
/// and the directions stay the same from frame to frame.
LightFrustum smallest_rectangle(const Points& points, const glm::dvec3& to_sun) noexcept {
  // Choose two axes across the direction of the sun.
  const glm::dvec3 helper =
      std::abs(to_sun.z) < 0.9 ? glm::dvec3(0.0, 0.0, 1.0) : glm::dvec3(0.0, 1.0, 0.0);
  const glm::dvec3 u = glm::normalize(glm::cross(helper, to_sun));
  const glm::dvec3 v = glm::cross(to_sun, u);
  LightFrustum best;
  double best_area_m2 = std::numeric_limits<double>::infinity();
  constexpr int kDirections = 32;
  for (int k = 0; k < kDirections; ++k) {
    // Measure the rectangle in this direction and keep the smallest.
    const double angle_rad = 0.5 * 3.14159265358979323846 * k / kDirections;
    const glm::dvec3 right = u * std::cos(angle_rad) + v * std::sin(angle_rad);
    const glm::dvec3 down = glm::cross(-to_sun, right);
    glm::dvec2 low{std::numeric_limits<double>::infinity()};
    glm::dvec2 high{-std::numeric_limits<double>::infinity()};
    for (std::size_t i = 0; i < points.count; ++i) {
      const glm::dvec2 p{glm::dot(right, points.points[i]), glm::dot(down, points.points[i])};
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    const double area_m2 = (high.x - low.x) * (high.y - low.y);
    if (area_m2 < best_area_m2) {
      best_area_m2 = area_m2;
      best.axes = {right, down, -to_sun};
      best.offset_m = {-low.x, -low.y, 0.0};
      best.extent_m = {high.x - low.x, high.y - low.y, 1.0};
    }
  }
  return best;
}

}  // namespace

bool visible_depth_range_m(const ViewVolume& view, double& near_m, double& far_m) noexcept {
  Points points;
  visible_points(view, view.near_m, view.far_m, points);
  if (points.count == 0) return false;
  // Find the nearest and the farthest of the points.
  const glm::dvec3 boresight = view.relworld_from_sensor[2];
  near_m = view.far_m;
  far_m = view.near_m;
  for (std::size_t i = 0; i < points.count; ++i) {
    const double depth_m = glm::dot(boresight, points.points[i]);
    near_m = std::min(near_m, depth_m);
    far_m = std::max(far_m, depth_m);
  }
  // Widen the range a little, because a plane that is seen head-on has no depth of its own.
  near_m = std::max(near_m * (1.0 - 1e-6), view.near_m);
  far_m = far_m * (1.0 + 1e-6);
  return far_m > near_m;
}

LightFrusta fit_light(const ViewVolume& view, const glm::dvec3& to_sun, std::uint32_t map_px,
                      std::uint32_t max_cascades, double margin_m, double pixel_rad) noexcept {
  EMIT_CHECK_OP(std::abs(glm::dot(to_sun, to_sun) - 1.0), <, 1e-6);
  EMIT_CHECK_OP(map_px, >=, 1U);
  EMIT_CHECK_OP(margin_m, >=, 0.0);
  LightFrusta best;
  double near_m = 0.0;
  double far_m = 0.0;
  if (!visible_depth_range_m(view, near_m, far_m)) return best;

  // Find the depth range of receivers and casters along the light, so that the near plane cuts
  // nothing off.
  const glm::dvec3 low_m = glm::min(view.scene_min_m, view.casters_min_m);
  const glm::dvec3 high_m = glm::max(view.scene_max_m, view.casters_max_m);
  double depth_low_m = std::numeric_limits<double>::infinity();
  double depth_high_m = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 8; ++i) {
    const glm::dvec3 corner{(i & 1U) != 0 ? high_m.x : low_m.x, (i & 2U) != 0 ? high_m.y : low_m.y,
                            (i & 4U) != 0 ? high_m.z : low_m.z};
    const double depth_m = glm::dot(-to_sun, corner);
    depth_low_m = std::min(depth_low_m, depth_m);
    depth_high_m = std::max(depth_high_m, depth_m);
  }

  // Try one frustum, then more, until the texels are fine enough.
  for (std::uint32_t count = 1; count <= std::clamp(max_cascades, 1U, 4U); ++count) {
    LightFrusta frusta;
    bool fine_enough = true;
    for (std::uint32_t i = 0; i < count; ++i) {
      // Divide the range by equal ratios of distance, because a pixel grows with distance and so
      // may a texel.
      const double begin_m = near_m * std::pow(far_m / near_m, double(i) / count);
      const double end_m = near_m * std::pow(far_m / near_m, double(i + 1) / count);
      Points points;
      visible_points(view, begin_m, end_m, points);
      if (points.count == 0) continue;
      // Fit the rectangle and widen it for filter taps.
      LightFrustum frustum = smallest_rectangle(points, to_sun);
      const double side_m = margin_m + 2.0 * std::max(frustum.extent_m.x, frustum.extent_m.y) /
                                           static_cast<double>(map_px);
      frustum.offset_m.x += side_m;
      frustum.offset_m.y += side_m;
      frustum.offset_m.z = -depth_low_m;
      frustum.extent_m.x += 2.0 * side_m;
      frustum.extent_m.y += 2.0 * side_m;
      frustum.extent_m.z = std::max(depth_high_m - depth_low_m, 1e-3);
      frustum.end_boresight_m = end_m;
      const double texel_m =
          std::max(frustum.extent_m.x, frustum.extent_m.y) / static_cast<double>(map_px);
      fine_enough = fine_enough && texel_m <= pixel_rad * begin_m;
      frusta.cascades[frusta.count++] = frustum;
    }
    if (frusta.count == 0) return best;
    best = frusta;
    if (fine_enough) break;
  }
  // Let the last frustum serve everything behind it too.
  best.cascades[best.count - 1].end_boresight_m = std::numeric_limits<double>::infinity();
  return best;
}

}  // namespace emit::renderer
