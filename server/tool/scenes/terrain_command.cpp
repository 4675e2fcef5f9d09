// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/terrain_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/scenegen/terrain.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/scenes/gdal_raster.hpp"
#include "tool/scenes/scenario_file.hpp"
#include "tool/scenes/terrain_raster.hpp"
#include "tool/scenes/terrain_scenario.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/work_folder.hpp"

namespace emit::tool {
namespace {

using physics::Result;

struct TerrainCommand {
  TerrainArea area;
  std::optional<double> radius_km;
  std::filesystem::path out;
  std::string name;
  std::string epoch_utc = "2014-06-21T09:00:00Z";
  double error_m = 0.5;
  double error_mrad = 0.5;
  std::string material = "soil";
  std::string land_cover;
  std::filesystem::path classes;
  double cover_mrad = 5.0;
  double eye_m = 100.0;
};

std::string unit_text(const TerrainHeights& heights) {
  const std::string name = heights.unit == "m"    ? "metres"
                           : heights.unit == "ft" ? "international feet"
                                                  : "US survey feet";
  return heights.unit_stated ? name : name + ", because the raster states no unit";
}

/// Says what was read, and warns of what is missing.
void report_heights(const TerrainCommand& command, const TerrainHeights& heights) {
  fmt::print(
      "{}: {} cells of {:.3g} m along an edge, radius {:.4g} km around {:.6f}, {:.6f} (latitude, "
      "longitude)\nheights: {:.1f} to {:.1f} m, in {}; they are taken as heights above the WGS-84 "
      "ellipsoid\n",
      command.area.dem, heights.grid.cells, heights.grid.spacing_m, 1e-3 * heights.radius_m,
      heights.lat_deg, heights.lon_deg, heights.lowest_m, heights.highest_m, unit_text(heights));
  if (heights.points_no_data == 0) return;
  const std::string share = fmt::format(
      "{} of {} points within the radius ({:.2g} %) have no data, the nearest {:.3g} km "
      "from the place",
      heights.points_no_data, heights.points,
      100.0 * static_cast<double>(heights.points_no_data) / static_cast<double>(heights.points),
      1e-3 * heights.nearest_no_data_m);
  warn(heights.points_filled > 0
           ? fmt::format("{}: they get the height {:g} m", share, *command.area.fill_m)
           : fmt::format("{}: the terrain has no ground there; --fill-m gives it a height, and "
                         "--radius-km ends it before",
                         share));
}

Result<TerrainCover> cover_of(const TerrainCommand& command, const TerrainHeights& heights,
                              const std::vector<std::string>& known,
                              const std::filesystem::path& work) {
  if (command.land_cover.empty()) return TerrainCover{{}, {command.material}, 0};
  auto cover =
      read_cover(command.land_cover, command.classes, command.material, known, heights, work);
  if (cover && cover->points_no_class > 0) {
    warn(fmt::format("{}: {} of {} points within the radius have no class, and get '{}'",
                     command.land_cover, cover->points_no_class, heights.points, command.material));
  }
  return cover;
}

/// Writes the scenario, loads it, and writes it again with the air that place and date give.
Result<void> write_scenario(const std::filesystem::path& file, TerrainScenario scenario) {
  for (int round = 0; round < 2; ++round) {
    if (auto done = write_text_file(file, terrain_scenario_text(scenario)); !done) return done;
    const auto loaded = config::load_scenario(file);
    if (!loaded) {
      return physics::make_error(
          physics::ErrorCode::config,
          fmt::format("the scenario does not load: {}", loaded.error().text));
    }
    scenario.weather = {loaded->clear_sky.air_mean_k, loaded->clear_sky.dew_point_k};
  }
  return {};
}

Result<void> make_terrain(const TerrainCommand& command, const std::string& name,
                          const std::vector<std::string>& known) {
  if (auto made = make_directory(command.out); !made) return made;
  WorkFolder work(false);
  if (auto made = work.create(command.out); !made) return made;
  auto heights = read_heights(command.area, work.path());
  if (!heights) return tl::unexpected(std::move(heights.error()));
  report_heights(command, *heights);
  const auto cover = cover_of(command, *heights, known, work.path());
  if (!cover) return tl::unexpected(cover.error());

  const scenegen::TerrainOptions options{.radius_m = heights->radius_m,
                                         .error_m = command.error_m,
                                         .error_rad = 1e-3 * command.error_mrad,
                                         .cover_rad = 1e-3 * command.cover_mrad};
  const auto terrain = scenegen::triangulate_terrain(heights->grid, cover->material, options);
  if (!terrain) return tl::unexpected(terrain.error());
  const std::string gltf = name + ".glb";
  const auto written = scenegen::write_terrain(command.out / gltf, *terrain, cover->names);
  if (!written) return tl::unexpected(written.error());
  fmt::print(
      "{}: {} triangles in {} tiles, {:.1f} MB; the vertical error is at most {:g} m or {:g} mrad "
      "from the place, whichever is larger\n",
      written->path.string(), terrain->triangles, terrain->tiles.size(),
      1e-6 * static_cast<double>(written->bytes), command.error_m, command.error_mrad);
  constexpr std::uint64_t kMany = 2'000'000;
  if (terrain->triangles > kMany) {
    warn(
        fmt::format("{} triangles warm up slowly; a larger --error-m or --error-mrad, or a "
                    "smaller --radius-km, makes fewer",
                    terrain->triangles));
  }

  const std::size_t half = heights->grid.cells / 2;
  const glm::dvec3 eye_world_m = scenegen::terrain_point_m(
      heights->grid.place, 0.0, 0.0,
      static_cast<double>(heights->grid.height_m[heights->grid.index(half, half)]) + command.eye_m);
  const auto file = command.out / (name + ".toml");
  auto done = write_scenario(
      file, {.name = name,
             .gltf = gltf,
             .source = fmt::format("Heights above the ellipsoid from {}, radius {:.4g} km.",
                                   std::filesystem::path(command.area.dem).filename().string(),
                                   1e-3 * heights->radius_m),
             .epoch_utc = command.epoch_utc,
             .material = command.material,
             .lat_deg = heights->lat_deg,
             .lon_deg = heights->lon_deg,
             .height_m = heights->grid.place.height.value(),
             .eye_world_m = eye_world_m,
             .look_at_world_m = terrain_view_m(*terrain, eye_world_m, heights->radius_m),
             .vertices = written->vertices,
             .weather = {}});
  if (!done) return done;
  fmt::print("{}: `emit render {} --time-s 0 --out terrain.exr --png terrain.png` shows it\n",
             file.string(), file.string());
  return {};
}

int run_terrain(const TerrainCommand& options) {
  TerrainCommand command = options;
  if (command.radius_km) command.area.radius_m = 1000.0 * *command.radius_km;
  std::vector<std::string> known;
  for (const scene::Material& material : material_library()) known.push_back(material.name);
  if (std::ranges::find(known, command.material) == known.end()) {
    return fail(kExitUsage, fmt::format("the library has no material '{}'", command.material));
  }
  const std::string name =
      command.name.empty() ? std::filesystem::path(command.area.dem).stem().string() : command.name;
  for (const char* extension : {".toml", ".glb"}) {
    if (auto done = check_new_file(command.out / (name + extension)); !done) {
      return fail(done.error());
    }
  }
  if (auto found = check_gdal(); !found) return fail(found.error());
  const InterruptGuard interrupt;
  if (auto done = make_terrain(command, name, known); !done) return fail_call(done.error());
  return kExitOk;
}

void add_terrain_options(CommandLine& line, TerrainCommand& options) {
  line.option("dem", options.area.dem,
              "Raster of heights that GDAL reads, of any projection, with one band")
      .type_name("DEM")
      .may_be_file()
      .required();
  line.output_folder("--out", options.out, "Folder for NAME.toml and NAME.glb").required();
  line.option("--name", options.name, "Name of the scenario; default: the raster's")
      .type_name("NAME");
  Option lat =
      line.option("--lat-deg", options.area.lat_deg,
                  "Latitude of the world origin, north positive; default: the raster's middle")
          .in_range(-90.0, 90.0);
  const Option lon =
      line.option("--lon-deg", options.area.lon_deg,
                  "Longitude of the world origin, east positive; default: the raster's middle")
          .in_range(-180.0, 180.0)
          .needs(lat);
  lat.needs(lon);
  line.option("--height-m", options.area.height_m,
              "Height of the world origin; default: the ground there")
      .in_range(-500.0, 9000.0);
  line.option("--radius-km", options.radius_km,
              "Distance to which the terrain reaches; default: the nearest edge of the raster")
      .in_range(0.01, 500.0);
  line.option("--cell-m", options.area.cell_m,
              "Largest distance of the points that are taken; default: that of the raster")
      .in_range(0.01, 10'000.0);
  line.option("--error-m", options.error_m,
              "Vertical error that triangles may have anywhere against the raster")
      .in_range(0.01, 1000.0)
      .show_default();
  line.option("--error-mrad", options.error_mrad,
              "Error that they may have as an angle seen from the world origin")
      .in_range(0.0, 100.0)
      .show_default();
  line.option("--height-unit", options.area.height_unit,
              "Unit of the heights; auto: as the raster states, else metres")
      .one_of({"auto", "m", "ft", "us-ft"})
      .show_default();
  line.option("--no-data", options.area.no_data,
              "Number that stands for no data; default: as the raster states");
  line.option("--fill-m", options.area.fill_m,
              "Height of points without data, for example 0 for the sea; default: no ground")
      .in_range(-500.0, 9000.0);
  line.option("--material", options.material, "Library material of the ground")
      .type_name("MATERIAL")
      .show_default();
  Option cover = line.option("--land-cover", options.land_cover,
                             "Raster of class numbers, which choose materials")
                     .type_name("RASTER")
                     .may_be_file();
  const Option classes =
      line.path("--classes", options.classes, "CSV file with the columns class and material")
          .needs(cover);
  cover.needs(classes);
  line.option("--cover-mrad", options.cover_mrad,
              "Angle to which borders of materials are resolved, seen from the world origin")
      .in_range(0.0, 1000.0)
      .show_default();
  line.option("--epoch", options.epoch_utc, "Instant of simulation time 0, RFC 3339 with offset")
      .type_name("INSTANT")
      .show_default();
  line.option("--eye-m", options.eye_m, "Height of the camera above the ground at the origin")
      .in_range(1.0, 20'000.0)
      .show_default();
}

}  // namespace

void add_terrain(CommandLine& scene) {
  scene.command<TerrainCommand>(
      {.name = "terrain",
       .text = "Write a scenario with the terrain of an elevation model; needs GDAL's programs",
       .example = "emit scene terrain dem.tif --out hills"},
      add_terrain_options, run_terrain);
}

}  // namespace emit::tool
