// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

/// Rasters of any format and projection that GDAL reads. Its programs gdalinfo and gdalwarp run as
/// child processes, so that emit does not link GDAL. Setup only; one thread.
namespace emit::tool {

/// Facts that gdalinfo states of a raster with one band.
struct RasterFacts {
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  double left = 0.0;          ///< of the first column, in the unit of the projection
  double top = 0.0;           ///< of the first row
  double pixel_width = 0.0;   ///< same unit
  double pixel_height = 0.0;  ///< negative where the first row is the northernmost
  bool placed = false;        ///< the four above are known
  double middle_lat_deg = 0.0;
  double middle_lon_deg = 0.0;
  std::string unit;  ///< of the values, as the file has it; empty: not stated
  double scale = 1.0;
  double offset = 0.0;  ///< value = stored * scale + offset
};

/// A square of points in the plane of the horizon at a place (physics::HorizonPlane).
struct RasterSquare {
  double lat_deg = 0.0;
  double lon_deg = 0.0;
  double half_edge_m = 0.0;
  std::uint32_t cells = 0;  ///< along an edge; there are cells + 1 points
};

/// Checks that the programs are installed. Errors: not_found, naming the package.
[[nodiscard]] physics::Result<void> check_gdal();

/// Asks gdalinfo. Files of messages go to the folder `work`. Errors: not_found; io, with the words
/// of the program; unsupported (several bands, no coordinate system, no place).
[[nodiscard]] physics::Result<RasterFacts> raster_facts(const std::string& raster,
                                                        const std::filesystem::path& work);

/// Returns size and resolution that gdalwarp suggests for the whole raster in the plane of the
/// horizon at a place, m. Errors: as above.
[[nodiscard]] physics::Result<RasterFacts> raster_around(const std::string& raster, double lat_deg,
                                                         double lon_deg,
                                                         const std::filesystem::path& work);

/// Rule that gives the value of a point between the cells of a raster.
enum class Resampling : std::uint8_t { bilinear, nearest };

/// Returns the stored values at the points of a square, rows from south to north; NaN: no data.
/// `no_data` replaces the number that the file declares. Errors: io, with the words of gdalwarp.
[[nodiscard]] physics::Result<std::vector<float>> warp_raster(const std::string& raster,
                                                              const RasterSquare& square,
                                                              Resampling resampling,
                                                              std::optional<double> no_data,
                                                              const std::filesystem::path& work);

}  // namespace emit::tool
