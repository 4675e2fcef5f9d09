// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/gdal_raster.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <fstream>
#include <string_view>
#include <system_error>

#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<std::string> program(const std::string& name) {
  const auto file = find_program(name);
  if (!file) {
    return make_error(
        ErrorCode::not_found,
        fmt::format("the program {} of GDAL, which reads rasters, is not found (Debian: apt-get "
                    "install gdal-bin)",
                    name));
  }
  return file->string();
}

/// The name of a raster as GDAL takes it. Names of its own, such as NETCDF:file:variable, are no
/// files and stay as they are.
std::string gdal_name(const std::string& raster) {
  std::error_code ignored;
  return std::filesystem::exists(raster, ignored) ? std::filesystem::absolute(raster).string()
                                                  : raster;
}

/// The projection of the plane of the horizon. The datum makes PROJ shift rasters of other datums.
std::string projection(double lat_deg, double lon_deg) {
  return fmt::format("+proj=ortho +lat_0={:.12f} +lon_0={:.12f} +datum=WGS84 +units=m +no_defs",
                     lat_deg, lon_deg);
}

/// Degrees from gdalinfo's "48d 0'54.00\"N"; empty where it has another form.
std::optional<double> angle_deg(const std::string& text) {
  int degrees = 0;
  int minutes = 0;
  double seconds = 0.0;
  char side = ' ';
  if (std::sscanf(text.c_str(), " %dd%d'%lf\"%c", &degrees, &minutes, &seconds, &side) != 4) {
    return std::nullopt;
  }
  const double deg = degrees + minutes / 60.0 + seconds / 3600.0;
  return side == 'S' || side == 'W' ? -deg : deg;
}

struct InfoText {
  RasterFacts facts;
  int bands = 0;
  bool has_system = false;
  bool has_middle = false;
};

/// Reads what gdalinfo prints, line by line.
InfoText read_info(std::istream& in) {
  InfoText out;
  RasterFacts& facts = out.facts;
  bool origin = false;
  bool pixel = false;
  std::string line;
  while (std::getline(in, line)) {
    const char* text = line.c_str();
    if (std::sscanf(text, "Size is %u, %u", &facts.columns, &facts.rows) == 2) continue;
    if (std::sscanf(text, "Origin = (%lf,%lf)", &facts.left, &facts.top) == 2) origin = true;
    if (std::sscanf(text, "Pixel Size = (%lf,%lf)", &facts.pixel_width, &facts.pixel_height) == 2) {
      pixel = true;
    }
    if (line.starts_with("Coordinate System is:") || line.starts_with("GCP Projection")) {
      out.has_system = true;
    }
    if (line.starts_with("Band ")) ++out.bands;
    if (line.starts_with("Center ")) {
      const std::size_t second = line.rfind('(');
      const std::size_t comma = line.find(',', second);
      if (second == std::string::npos || comma == std::string::npos) continue;
      const auto lon = angle_deg(line.substr(second + 1, comma - second - 1));
      const auto lat = angle_deg(line.substr(comma + 1));
      if (!lon || !lat) continue;
      out.has_middle = true;
      facts.middle_lon_deg = *lon;
      facts.middle_lat_deg = *lat;
    }
    constexpr std::string_view kUnit = "  Unit Type: ";
    if (line.starts_with(kUnit)) facts.unit = line.substr(kUnit.size());
    double offset = 0.0;
    double scale = 1.0;
    if (std::sscanf(text, "  Offset: %lf, Scale:%lf", &offset, &scale) == 2) {
      facts.offset = offset;
      facts.scale = scale;
    }
  }
  facts.placed = origin && pixel;
  return out;
}

Result<InfoText> ask_gdalinfo(const std::string& raster, const std::filesystem::path& work) {
  const auto gdalinfo = program("gdalinfo");
  if (!gdalinfo) return tl::unexpected(gdalinfo.error());
  const auto log = work / "gdalinfo.log";
  if (auto done =
          run_program({*gdalinfo, "-nomd", "-norat", "-noct", "-nogcp", gdal_name(raster)}, log);
      !done) {
    return tl::unexpected(std::move(done.error()).with_context(raster));
  }
  std::ifstream in(log);
  return read_info(in);
}

}  // namespace

Result<void> check_gdal() {
  for (const char* name : {"gdalinfo", "gdalwarp"}) {
    if (auto found = program(name); !found) return tl::unexpected(std::move(found.error()));
  }
  return {};
}

Result<RasterFacts> raster_facts(const std::string& raster, const std::filesystem::path& work) {
  auto info = ask_gdalinfo(raster, work);
  if (!info) return tl::unexpected(std::move(info.error()));
  if (info->bands != 1) {
    return make_error(
        ErrorCode::unsupported,
        fmt::format("{}: the raster has {} bands; choose one with gdal_translate -b N", raster,
                    info->bands));
  }
  if (!info->has_system) {
    return make_error(
        ErrorCode::unsupported,
        fmt::format("{}: the raster names no coordinate system; gdal_translate -a_srs EPSG:N gives "
                    "it one",
                    raster));
  }
  if (!info->has_middle) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("{}: gdalinfo gives no latitude and longitude of its middle; "
                                  "gdalwarp -t_srs EPSG:4326 places the raster",
                                  raster));
  }
  return info->facts;
}

Result<RasterFacts> raster_around(const std::string& raster, double lat_deg, double lon_deg,
                                  const std::filesystem::path& work) {
  const auto gdalwarp = program("gdalwarp");
  if (!gdalwarp) return tl::unexpected(gdalwarp.error());
  const auto virtual_raster = work / "around.vrt";
  if (auto done =
          run_program({*gdalwarp, "-q", "-overwrite", "-of", "VRT", "-t_srs",
                       projection(lat_deg, lon_deg), gdal_name(raster), virtual_raster.string()},
                      work / "gdalwarp.log");
      !done) {
    return tl::unexpected(std::move(done.error()).with_context(raster));
  }
  auto info = ask_gdalinfo(virtual_raster.string(), work);
  if (!info) return tl::unexpected(std::move(info.error()));
  if (!info->facts.placed || !(info->facts.pixel_width > 0.0)) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("{}: gdalwarp finds no size of its cells in metres", raster));
  }
  return info->facts;
}

Result<std::vector<float>> warp_raster(const std::string& raster, const RasterSquare& square,
                                       Resampling resampling, std::optional<double> no_data,
                                       const std::filesystem::path& work) {
  const auto gdalwarp = program("gdalwarp");
  if (!gdalwarp) return tl::unexpected(gdalwarp.error());
  const auto file = work / "warped.img";
  // The points of the square are the middles of gdalwarp's cells.
  const std::string outer_m =
      fmt::format("{:.9f}", square.half_edge_m * (1.0 + 1.0 / static_cast<double>(square.cells)));
  const std::string points = fmt::format("{}", square.cells + 1);
  // Positions are exact to a hundredth of a cell of the raster.
  std::vector<std::string> call{*gdalwarp,
                                "-q",
                                "-overwrite",
                                "-of",
                                "ENVI",
                                "-ot",
                                "Float32",
                                "-et",
                                "0.01",
                                "-dstnodata",
                                "nan",
                                "-r",
                                resampling == Resampling::bilinear ? "bilinear" : "near",
                                "-t_srs",
                                projection(square.lat_deg, square.lon_deg),
                                "-te",
                                "-" + outer_m,
                                "-" + outer_m,
                                outer_m,
                                outer_m,
                                "-ts",
                                points,
                                points};
  if (no_data) {
    call.emplace_back("-srcnodata");
    call.push_back(fmt::format("{}", *no_data));
  }
  call.push_back(gdal_name(raster));
  call.push_back(file.string());
  if (auto done = run_program(call, work / "gdalwarp.log"); !done) {
    return tl::unexpected(std::move(done.error()).with_context(raster));
  }
  const std::size_t edge = std::size_t{square.cells} + 1;
  std::vector<float> values(edge * edge);
  std::ifstream in(file, std::ios::binary);
  for (std::size_t row = edge; row-- > 0;) {  // the file begins in the north
    in.read(reinterpret_cast<char*>(values.data() + row * edge),
            static_cast<std::streamsize>(edge * sizeof(float)));
  }
  if (!in || in.peek() != std::ifstream::traits_type::eof()) {
    return make_error(ErrorCode::io,
                      fmt::format("{}: gdalwarp has written {} bytes in place of {}", raster,
                                  std::filesystem::file_size(file), values.size() * sizeof(float)));
  }
  return values;
}

}  // namespace emit::tool
