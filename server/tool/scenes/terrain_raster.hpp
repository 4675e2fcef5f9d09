// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scenegen/terrain.hpp"

/// Heights and materials of a terrain, from rasters. Setup only; one thread.
namespace emit::tool {

/// Which part of an elevation model is wanted, and how its numbers are to be read.
struct TerrainArea {
  std::string dem;
  std::optional<double> lat_deg;  ///< absent, with lon_deg: the middle of the raster
  std::optional<double> lon_deg;
  std::optional<double> height_m;    ///< of the world origin; absent: the ground there
  std::optional<double> radius_m;    ///< absent: what the raster holds
  std::optional<double> cell_m;      ///< absent: that of the raster
  std::string height_unit = "auto";  ///< auto, m, ft or us-ft
  std::optional<double> no_data;     ///< stored number that stands for no data
  std::optional<double> fill_m;      ///< height of points without data
};

/// The heights with what has been found out about them.
struct TerrainHeights {
  scenegen::HeightGrid grid;
  double lat_deg = 0.0;
  double lon_deg = 0.0;
  double radius_m = 0.0;
  double lowest_m = 0.0;  ///< within the radius
  double highest_m = 0.0;
  std::string unit;                ///< "m", "ft" or "us-ft"
  bool unit_stated = false;        ///< by the file or the user
  std::size_t points = 0;          ///< within the radius
  std::size_t points_no_data = 0;  ///< of them
  std::size_t points_filled = 0;   ///< of them
  double nearest_no_data_m = 0.0;  ///< distance from the place; 0: there is none
};

/// Reads heights by GDAL. Errors: those of gdal_raster.hpp; invalid_argument (the place lies
/// outside, too many cells, an unknown unit); parse (heights that no place on earth has).
[[nodiscard]] physics::Result<TerrainHeights> read_heights(const TerrainArea& area,
                                                           const std::filesystem::path& work);

/// Materials of the points of a grid.
struct TerrainCover {
  std::vector<std::uint8_t> material;  ///< index into `names`; empty: all have the first
  std::vector<std::string> names;
  std::size_t points_no_class = 0;  ///< within the radius, which have the first material
};

/// Reads a raster of land cover. `classes` is a CSV file with the columns `class` and `material`.
/// Points without a class get `default_material`. `known` are the materials that there are. Errors:
/// those of gdal_raster.hpp and CsvTable; parse (a class that the file lacks, with the count of its
/// points; a material that is unknown; a class given twice).
[[nodiscard]] physics::Result<TerrainCover> read_cover(const std::string& raster,
                                                       const std::filesystem::path& classes,
                                                       const std::string& default_material,
                                                       const std::vector<std::string>& known,
                                                       const TerrainHeights& heights,
                                                       const std::filesystem::path& work);

}  // namespace emit::tool
