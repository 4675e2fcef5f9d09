// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/terrain_raster.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>

#include "emit/physics/csv.hpp"
#include "tool/scenes/gdal_raster.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Heights that places of scenarios have; the land of the earth lies between -430 and 8849 m.
constexpr double kLowestM = -500.0;
constexpr double kHighestM = 9000.0;
/// Beyond, the plane of the horizon no longer shows the earth nearly to scale.
constexpr double kMaxRadiusM = 500e3;

/// Metres of a unit of height; empty: unknown.
std::optional<double> metres_of(const std::string& unit) {
  constexpr double kFootM = 0.3048;
  constexpr double kSurveyFootM = 1200.0 / 3937.0;
  if (unit == "m") return 1.0;
  if (unit == "ft") return kFootM;
  if (unit == "us-ft") return kSurveyFootM;
  return std::nullopt;
}

/// The unit by one of the names that rasters have for it; other names come back as they are.
std::string unit_by_name(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char* each : {"m", "metre", "metres", "meter", "meters"}) {
    if (name == each) return "m";
  }
  for (const char* each : {"ft", "foot", "feet", "international foot"}) {
    if (name == each) return "ft";
  }
  for (const char* each : {"us-ft", "ftus", "us survey foot", "foot_us"}) {
    if (name == each) return "us-ft";
  }
  return name;
}

/// Distance of each point of a grid from its middle, m.
class Distances {
 public:
  explicit Distances(const scenegen::HeightGrid& grid) : grid_(grid) {}
  [[nodiscard]] double of_m(std::size_t index) const {
    return std::hypot(grid_.offset_m(index % grid_.points()),
                      grid_.offset_m(index / grid_.points()));
  }

 private:
  const scenegen::HeightGrid& grid_;
};

Result<std::string> height_unit(const TerrainArea& area, const RasterFacts& facts) {
  const std::string stated = unit_by_name(facts.unit);
  if (area.height_unit != "auto") return area.height_unit;
  if (stated.empty()) return std::string("m");
  if (metres_of(stated)) return stated;
  return make_error(ErrorCode::invalid_argument,
                    fmt::format("{}: its heights have the unit '{}', which is none of m, ft and "
                                "us-ft; --height-unit says what they are",
                                area.dem, facts.unit));
}

/// Distance from the place to the nearest edge of the raster. Errors: the place lies outside.
Result<double> distance_to_edge_m(const TerrainArea& area, const RasterFacts& around,
                                  double lat_deg, double lon_deg) {
  const double right = around.left + around.pixel_width * around.columns;
  const double bottom = around.top + around.pixel_height * around.rows;
  const double edge_m = std::min({-around.left, right, around.top, -bottom});
  if (edge_m > 0.0) return edge_m;
  return make_error(
      ErrorCode::invalid_argument,
      fmt::format("{}: the place {:.6f}, {:.6f} (latitude, longitude) lies outside the raster, "
                  "which reaches from {:.0f} to {:.0f} m east and from {:.0f} to {:.0f} m north",
                  area.dem, lat_deg, lon_deg, around.left, right, bottom, around.top));
}

/// Turns stored numbers into metres, and checks them. Counts what lies within `radius_m`.
Result<void> convert_heights(const TerrainArea& area, const RasterFacts& facts,
                             TerrainHeights& out) {
  const double unit_m = metres_of(out.unit).value_or(1.0);
  const Distances distances(out.grid);
  double lowest_m = std::numeric_limits<double>::infinity();
  double highest_m = -lowest_m;
  std::size_t impossible = 0;
  for (float& value : out.grid.height_m) {
    if (!std::isfinite(value)) {
      value = std::numeric_limits<float>::quiet_NaN();
      continue;
    }
    const double height_m = unit_m * (static_cast<double>(value) * facts.scale + facts.offset);
    lowest_m = std::min(lowest_m, height_m);
    highest_m = std::max(highest_m, height_m);
    if (height_m < kLowestM || height_m > kHighestM) ++impossible;
    value = static_cast<float>(height_m);
  }
  if (impossible == 0) return {};
  return make_error(
      ErrorCode::parse,
      fmt::format(
          "{}: {} of {} points have heights beyond {:.0f} .. {:.0f} m, from {:.6g} to {:.6g} "
          "m; where a number stands for no data, --no-data names it; otherwise see "
          "--height-unit",
          area.dem, impossible, out.grid.height_m.size(), kLowestM, kHighestM, lowest_m,
          highest_m));
}

/// Ends a radius that nobody has stated at the edge of the data. Edges of rasters in other
/// projections are curved, so that the nearest one is known only now.
void shrink_radius(TerrainHeights& heights) {
  constexpr double kInnerFrac = 0.9;  // a gap farther inside is a hole, not the edge
  const Distances distances(heights.grid);
  const double inner_m = kInnerFrac * heights.radius_m;
  for (std::size_t i = 0; i < heights.grid.height_m.size(); ++i) {
    if (std::isfinite(heights.grid.height_m[i])) continue;
    const double distance_m = distances.of_m(i);
    if (distance_m > inner_m) heights.radius_m = std::min(heights.radius_m, distance_m);
  }
}

void count_points(const TerrainArea& area, TerrainHeights& heights) {
  const Distances distances(heights.grid);
  heights.lowest_m = std::numeric_limits<double>::infinity();
  heights.highest_m = -heights.lowest_m;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < heights.grid.height_m.size(); ++i) {
    const double distance_m = distances.of_m(i);
    float& height_m = heights.grid.height_m[i];
    const bool within = distance_m < heights.radius_m;
    if (within) ++heights.points;
    if (!std::isfinite(height_m)) {
      if (within) {
        ++heights.points_no_data;
        nearest_m = std::min(nearest_m, distance_m);
      }
      if (!area.fill_m) continue;
      height_m = static_cast<float>(*area.fill_m);
      if (within) ++heights.points_filled;
    }
    if (!within) continue;
    heights.lowest_m = std::min(heights.lowest_m, static_cast<double>(height_m));
    heights.highest_m = std::max(heights.highest_m, static_cast<double>(height_m));
  }
  if (std::isfinite(nearest_m)) heights.nearest_no_data_m = nearest_m;
}

}  // namespace

Result<TerrainHeights> read_heights(const TerrainArea& area, const std::filesystem::path& work) {
  const auto facts = raster_facts(area.dem, work);
  if (!facts) return tl::unexpected(facts.error());
  TerrainHeights out;
  out.lat_deg = area.lat_deg.value_or(facts->middle_lat_deg);
  out.lon_deg = area.lon_deg.value_or(facts->middle_lon_deg);
  auto unit = height_unit(area, *facts);
  if (!unit) return tl::unexpected(std::move(unit.error()));
  out.unit = *unit;
  out.unit_stated = area.height_unit != "auto" || !facts->unit.empty();

  const auto around = raster_around(area.dem, out.lat_deg, out.lon_deg, work);
  if (!around) return tl::unexpected(around.error());
  const auto edge_m = distance_to_edge_m(area, *around, out.lat_deg, out.lon_deg);
  if (!edge_m) return tl::unexpected(edge_m.error());
  out.radius_m = area.radius_m.value_or(std::min(*edge_m, kMaxRadiusM));
  const double cell_m = area.cell_m.value_or(around->pixel_width);
  const double cells = 2.0 * out.radius_m / cell_m;
  if (cells > scenegen::kMaxTerrainCells) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format(
            "{}: a radius of {:.4g} km with cells of {:.4g} m needs {:.0f} cells along an "
            "edge, and {} is the most; a smaller --radius-km or a larger --cell-m (at least "
            "{:.4g}) fits",
            area.dem, 1e-3 * out.radius_m, cell_m, cells, scenegen::kMaxTerrainCells,
            2.0 * out.radius_m / scenegen::kMaxTerrainCells));
  }
  out.grid.cells = std::max(2U, std::bit_ceil(static_cast<std::uint32_t>(std::ceil(cells))));
  out.grid.spacing_m = 2.0 * out.radius_m / out.grid.cells;
  auto values = warp_raster(area.dem, {out.lat_deg, out.lon_deg, out.radius_m, out.grid.cells},
                            Resampling::bilinear, area.no_data, work);
  if (!values) return tl::unexpected(std::move(values.error()));
  out.grid.height_m = std::move(*values);
  if (auto done = convert_heights(area, *facts, out); !done) {
    return tl::unexpected(std::move(done.error()));
  }
  if (!area.radius_m) shrink_radius(out);
  count_points(area, out);

  const std::size_t half = out.grid.cells / 2;
  const float ground_m = out.grid.height_m[out.grid.index(half, half)];
  if (!std::isfinite(ground_m)) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("{}: the raster has no data at the place {:.6f}, {:.6f} (latitude, longitude); "
                    "choose another one, or fill gaps by --fill-m",
                    area.dem, out.lat_deg, out.lon_deg));
  }
  out.grid.place = {physics::degrees(out.lat_deg), physics::degrees(out.lon_deg),
                    physics::Metres(area.height_m.value_or(static_cast<double>(ground_m)))};
  return out;
}

Result<TerrainCover> read_cover(const std::string& raster, const std::filesystem::path& classes,
                                const std::string& default_material,
                                const std::vector<std::string>& known,
                                const TerrainHeights& heights, const std::filesystem::path& work) {
  const auto table = physics::CsvTable::read(classes);
  if (!table) return tl::unexpected(table.error());
  const auto numbers = table->numbers("class");
  if (!numbers) return tl::unexpected(numbers.error());
  const auto materials = table->texts("material");
  if (!materials) return tl::unexpected(materials.error());
  TerrainCover out;
  out.names.push_back(default_material);
  std::map<double, std::uint8_t> index_of;
  for (std::size_t row = 0; row < table->rows(); ++row) {
    const std::string material((*materials)[row]);
    const auto place = fmt::format("{}:{}", classes.string(), table->line_of(row));
    if (std::ranges::find(known, material) == known.end()) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}: the library has no material '{}'", place, material));
    }
    auto found = std::ranges::find(out.names, material);
    if (found == out.names.end()) {
      if (out.names.size() > std::numeric_limits<std::uint8_t>::max()) {
        return make_error(ErrorCode::parse, fmt::format("{}: more than 256 materials", place));
      }
      out.names.push_back(material);
      found = out.names.end() - 1;
    }
    const auto index = static_cast<std::uint8_t>(found - out.names.begin());
    if (!index_of.emplace((*numbers)[row], index).second) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}: class {} is given twice", place, (*numbers)[row]));
    }
  }

  if (auto facts = raster_facts(raster, work); !facts) {
    return tl::unexpected(std::move(facts.error()));
  }
  const auto values =
      warp_raster(raster,
                  {heights.lat_deg, heights.lon_deg,
                   0.5 * heights.grid.spacing_m * heights.grid.cells, heights.grid.cells},
                  Resampling::nearest, std::nullopt, work);
  if (!values) return tl::unexpected(values.error());
  const Distances distances(heights.grid);
  std::map<double, std::size_t> unknown;  // points of classes that the file lacks
  out.material.resize(values->size());
  for (std::size_t i = 0; i < values->size(); ++i) {
    const auto number = static_cast<double>((*values)[i]);
    const bool counts =
        std::isfinite(heights.grid.height_m[i]) && distances.of_m(i) < heights.radius_m;
    if (!std::isfinite(number)) {
      if (counts) ++out.points_no_class;
      continue;
    }
    const auto found = index_of.find(number);
    if (found != index_of.end()) {
      out.material[i] = found->second;
    } else if (counts) {
      ++unknown[number];
    }
  }
  if (!unknown.empty()) {
    std::string list;
    for (const auto& [number, points] : unknown) {
      list += fmt::format("{}{:g} ({} points)", list.empty() ? "" : ", ", number, points);
    }
    return make_error(ErrorCode::parse, fmt::format("{}: {} has no material for the classes {}",
                                                    raster, classes.string(), list));
  }
  return out;
}

}  // namespace emit::tool
