// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::verify {

/// Half extent of "infinite" geometry, as a multiple of the row's largest length.
inline constexpr double kInfiniteFactor = 1000.0;

/// Geometry for one row of a visibility table: closed solids and a ground plane in world axes,
/// metres, and the point at which visibility is measured.
struct VisibilityRow {
  std::vector<glm::dvec3> positions_m;
  std::vector<std::uint32_t> indices;  ///< counter-clockwise from outside
  glm::dvec3 point_m{0.0};
  glm::dvec3 normal{0.0, 0.0, 1.0};   ///< zero for a point without tangent plane (edge, corner)
  glm::dvec3 outward{0.0, 0.0, 1.0};  ///< unit vector away from the solid
  glm::dvec3 to_sun{0.0, 0.0, 1.0};
  bool sheets = false;    ///< true for open surfaces, seen from both sides
  double length_m = 1.0;  ///< largest length of the row
};

/// Returns true when the point lies on a face.
[[nodiscard]] inline bool on_face(const VisibilityRow& row) {
  return row.normal != glm::dvec3(0.0);
}

/// Returns the row for the renderer: one static mesh in world axes.
[[nodiscard]] scene::SceneGeometry scene_geometry(const VisibilityRow& row);

/// Returns a wall of height H, with the point at a distance behind it and the sun at an elevation
/// beyond it. Errors (invalid_argument): a height, distance or elevation that is not positive.
[[nodiscard]] physics::Result<VisibilityRow> wall_shadow_row(double height_m, double elevation_rad,
                                                             double distance_m);

/// Returns the edge of a wall seen at 45 degrees, with the sun's centre `delta_rad` above it.
[[nodiscard]] VisibilityRow sun_disc_row(double delta_rad);

/// Returns the geometry of a row of the sky-view table. `kind` is flat, wall, canyon, vgroove,
/// disc, box, edge or cube_corner; `p` holds p1..p7. Errors (invalid_argument): unknown kind, a
/// length that is not positive.
[[nodiscard]] physics::Result<VisibilityRow> sky_view_row(std::string_view kind,
                                                          const std::array<double, 7>& p);

}  // namespace emit::verify
