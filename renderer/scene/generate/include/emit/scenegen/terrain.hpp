// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/geodesy.hpp"
#include "emit/scenegen/generate.hpp"

/// Terrain from a grid of heights: triangles on the ellipsoid, large where the ground is even or
/// far away.
namespace emit::scenegen {

/// Largest number of cells along an edge of the grid. The work on such a grid needs 1.7 GB.
inline constexpr std::uint32_t kMaxTerrainCells = 8192;
/// Vertices are multiples of this length, 2^-10 m, in the axes of the world. All tiles then have
/// the same bits where they meet.
inline constexpr double kTerrainStepM = 1.0 / 1024.0;

/// Heights above the ellipsoid in the plane of the horizon at a place (physics::HorizonPlane). The
/// place is the middle of the grid and the origin of the world frame, height included.
struct HeightGrid {
  physics::GeoPlace place;
  std::uint32_t cells = 0;      ///< along an edge: a power of two, 2 .. kMaxTerrainCells
  double spacing_m = 0.0;       ///< distance of neighbouring points, 0.01 .. 10000
  std::vector<float> height_m;  ///< (cells + 1)^2, rows from south to north; NaN: no data

  [[nodiscard]] std::size_t points() const noexcept { return std::size_t{cells} + 1; }
  [[nodiscard]] std::size_t index(std::size_t column, std::size_t row) const noexcept {
    return row * points() + column;
  }
  /// East coordinate of a column, and north coordinate of a row.
  [[nodiscard]] double offset_m(std::size_t column_or_row) const noexcept {
    return spacing_m * (static_cast<double>(column_or_row) - 0.5 * static_cast<double>(cells));
  }
};

/// Limits of the triangles. In these, d is the horizontal distance of a point from the place.
struct TerrainOptions {
  double radius_m = 0.0;    ///< > 0; no triangle lies wholly beyond it
  double error_m = 0.5;     ///< 0.01 .. 1000; the vertical error is at most max(error_m, ...
  double error_rad = 5e-4;  ///< 0 .. 0.1; ... error_rad d)
  /// 0 .. 1; triangles with points of two materials have legs of at most cover_rad d, or of a cell.
  double cover_rad = 5e-3;
  std::uint32_t max_tile_triangles = 50'000;  ///< >= 1000
};

/// Triangles of a tile that have one material.
struct TerrainPart {
  std::uint32_t material = 0;
  std::vector<glm::vec3> positions_m;  ///< from the origin of the tile: east, north, up
  std::vector<glm::vec3> normals;
  std::vector<std::uint32_t> indices;
};
/// Neighbouring triangles. The sum of origin and position is exact in double precision.
struct TerrainTile {
  glm::dvec3 origin_world_m{0.0};  ///< whole metres
  std::vector<TerrainPart> parts;
};
struct Terrain {
  std::vector<TerrainTile> tiles;
  std::uint64_t triangles = 0;
  double area_m2 = 0.0;
};

/// Returns the world position of a point of the plane of the horizon at `height_m` above the
/// ellipsoid. The origin of the world has the height of `place`.
/// @pre the point is nearer than 3000 km.
[[nodiscard]] glm::dvec3 terrain_point_m(const physics::GeoPlace& place, double east_m,
                                         double north_m, double height_m);

/// Returns a right-triangulated irregular network (Evans, Kirkpatrick and Townsend, Algorithmica
/// 30, 2001) over a grid. The error of a triangle is measured at each of its points along the local
/// vertical, in the world frame, so that the curvature of the earth counts. Errors of vertices
/// include those of all that depend on them, which keeps neighbours without cracks. Triangles with
/// a point without data are divided to single cells, and those of them are left out.
///
/// `material` holds a number for each point; empty: all are 0. A triangle has that of the point
/// nearest to its middle. Errors: invalid_argument names the value. Thread: any. Real time: setup
/// only.
[[nodiscard]] physics::Result<Terrain> triangulate_terrain(const HeightGrid& grid,
                                                           std::span<const std::uint8_t> material,
                                                           const TerrainOptions& options);

/// Writes a terrain as glTF 2.0 binary file with a mesh and a node for each tile.
/// @pre every TerrainPart::material is below the number of names.
/// Errors: io.
[[nodiscard]] physics::Result<GeneratedFile> write_terrain(
    const std::filesystem::path& file, const Terrain& terrain,
    std::span<const std::string> material_names);

}  // namespace emit::scenegen
