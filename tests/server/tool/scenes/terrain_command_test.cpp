// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <glm/common.hpp>
#include <glm/matrix.hpp>
#include <string>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/geodesy.hpp"
#include "emit/scene/gltf_import.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using physics::degrees;
using physics::GeoPlace;
using physics::Metres;

bool has_gdal() {
  return std::system("command -v gdalinfo gdalwarp gdal_translate > /dev/null 2>&1") == 0;
}
#define NEEDS_GDAL() \
  if (!has_gdal()) GTEST_SKIP() << "GDAL's programs (Debian gdal-bin) are not installed"

void run_gdal(const std::vector<std::string>& call) {
  std::vector<std::string> whole{"/usr/bin/env"};
  whole.insert(whole.end(), call.begin(), call.end());
  const ProcessResult result = run_process(whole);
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
}

/// A raster of square cells in degrees, or in the unit of another coordinate system.
struct Raster {
  int columns = 101;
  int rows = 101;
  double west = 11.0;
  double south = 47.0;
  double cell = 0.001;
  std::string system = "EPSG:4326";
  std::vector<std::string> more = {};  ///< options of gdal_translate
};

/// Writes a GeoTIFF of floats. `value` gets the middle of each cell.
void write_raster(const std::string& file, const Raster& raster,
                  const std::function<double(double x, double y)>& value) {
  std::string text = fmt::format(
      "ncols {}\nnrows {}\nxllcorner {}\nyllcorner {}\ncellsize {}\nNODATA_value -9999\n",
      raster.columns, raster.rows, raster.west, raster.south, raster.cell);
  for (int row = raster.rows - 1; row >= 0; --row) {
    for (int column = 0; column < raster.columns; ++column) {
      text += fmt::format("{:.4f} ", value(raster.west + (column + 0.5) * raster.cell,
                                           raster.south + (row + 0.5) * raster.cell));
    }
    text += '\n';
  }
  write_text(file + ".asc", text);
  std::vector<std::string> call{"gdal_translate", "-q", "-ot", "Float32", "-a_srs", raster.system};
  call.insert(call.end(), raster.more.begin(), raster.more.end());
  call.push_back(file + ".asc");
  call.push_back(file);
  run_gdal(call);
}

/// Vertices of a terrain as places on the earth. `origin` is the place of its scenario.
std::vector<GeoPlace> places_of(const std::string& glb, const GeoPlace& origin) {
  std::vector<GeoPlace> out;
  const auto model = scene::import_gltf(glb);
  EXPECT_TRUE(model) << model.error().text;
  if (!model) return out;
  for (const scene::GltfPlacement& placement : model->placements) {
    for (const glm::vec3& position : model->meshes[placement.mesh].positions_m) {
      const glm::dvec4 p = placement.gltf_from_mesh * glm::dvec4(glm::dvec3(position), 1.0);
      out.push_back(physics::place_at_ecef(
          physics::ecef_m(origin) + physics::ecef_from_enu(origin) * glm::dvec3(-p.x, p.z, p.y)));
    }
  }
  return out;
}

double number_after(const std::string& text, const std::string& key) {
  const std::size_t at = text.find("\n" + key + " = ");
  EXPECT_NE(at, std::string::npos) << key;
  return at == std::string::npos ? 0.0 : std::atof(text.c_str() + at + key.size() + 4);
}

GeoPlace origin_of(const std::string& toml) {
  const std::string text = read_text(toml);
  return {degrees(number_after(text, "lat_deg")), degrees(number_after(text, "lon_deg")),
          Metres(number_after(text, "height_m"))};
}

/// Heights that grow by latitude and longitude alike tell where a raster's cells have come to lie.
TEST(CliTerrain, vertices_lie_where_the_raster_has_their_height) {
  NEEDS_GDAL();
  const TemporaryFolder folder;
  // A degree is 1000 m of height, so that half a cell is 0.5 m.
  write_raster(folder.file("lat.tif"), {},
               [](double, double lat) { return 300.0 + 1000.0 * (lat - 47.0); });
  write_raster(folder.file("lon.tif"), {},
               [](double lon, double) { return 300.0 + 1000.0 * (lon - 11.0); });
  for (const bool projected : {false, true}) {
    for (const bool by_latitude : {true, false}) {
      std::string file = folder.file(by_latitude ? "lat.tif" : "lon.tif");
      const std::string out = folder.file(fmt::format("o{}{}", projected, by_latitude));
      if (projected) {
        const std::string utm = file + ".utm.tif";
        run_gdal({"gdalwarp", "-q", "-r", "bilinear", "-t_srs", "EPSG:32632", "-dstnodata", "-9999",
                  file, utm});
        file = utm;
      }
      const ProcessResult made =
          run_emit({"scene", "terrain", file, "--name", "t", "--out", out, "--radius-km", "3",
                    "--error-m", "0.02", "--error-mrad", "0"});
      ASSERT_EQ(made.exit_code, 0) << made.out << made.err;
      EXPECT_NE(made.out.find("because the raster states no unit"), std::string::npos) << made.out;
      const auto places = places_of(out + "/t.glb", origin_of(out + "/t.toml"));
      ASSERT_GT(places.size(), 20U);
      for (const GeoPlace& place : places) {
        const double expected_m =
            300.0 + 1000.0 * (by_latitude ? to_degrees(place.latitude) - 47.0
                                          : to_degrees(place.longitude) - 11.0);
        ASSERT_NEAR(place.height.value(), expected_m, 0.5 * (projected ? 1.5 : 1.0));
      }
    }
  }
}

TEST(CliTerrain, the_place_and_its_ground_are_the_origin_of_the_world) {
  NEEDS_GDAL();
  const TemporaryFolder folder;
  write_raster(folder.file("d.tif"), {}, [](double lon, double lat) {
    return 700.0 + 2000.0 * (lat - 47.0) + 3000.0 * (lon - 11.0);
  });
  const ProcessResult made =
      run_emit({"scene", "terrain", folder.file("d.tif"), "--out", folder.file("o"), "--lat-deg",
                "47.06", "--lon-deg", "11.04"});
  ASSERT_EQ(made.exit_code, 0) << made.out << made.err;
  const GeoPlace origin = origin_of(folder.file("o/d.toml"));
  EXPECT_NEAR(to_degrees(origin.latitude), 47.06, 1e-9);
  EXPECT_NEAR(origin.height.value(), 700.0 + 2000.0 * 0.06 + 3000.0 * 0.04, 0.2);
  // The nearest edge of the raster, which the radius ends at, lies 3.04 km west.
  const std::size_t at = made.out.find("radius ");
  ASSERT_NE(at, std::string::npos) << made.out;
  EXPECT_NEAR(std::atof(made.out.c_str() + at + 7), 3.04, 0.05) << made.out;
  EXPECT_TRUE(made.err.empty()) << made.err;
  EXPECT_EQ(
      run_emit({"scene", "terrain", folder.file("d.tif"), "--out", folder.file("o")}).exit_code,
      1);  // it is not written over
}

TEST(CliTerrain, feet_become_metres) {
  NEEDS_GDAL();
  const TemporaryFolder folder;
  write_raster(folder.file("d.tif"), {}, [](double, double) { return 1000.0; });
  for (const auto& [unit, metres] : {std::pair<std::string, double>{"m", 1000.0},
                                     {"ft", 304.8},
                                     {"us-ft", 1000.0 * 1200.0 / 3937.0}}) {
    const std::string out = folder.file("o-" + unit);
    const ProcessResult made = run_emit({"scene", "terrain", folder.file("d.tif"), "--out", out,
                                         "--height-unit", unit, "--cell-m", "500"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_NEAR(origin_of(out + "/d.toml").height.value(), metres, 1e-3);
  }
  // The raster's own unit counts without the option, and an unknown one is refused.
  run_gdal({"gdal_translate", "-q", "-of", "VRT", "-a_srs", "EPSG:4326", folder.file("d.tif.asc"),
            folder.file("v.vrt")});
  const std::string vrt = read_text(folder.file("v.vrt"));
  const auto with_unit = [&](const std::string& unit) {
    std::string changed = vrt;
    changed.insert(changed.find("</VRTRasterBand>"), "<UnitType>" + unit + "</UnitType>");
    write_text(folder.file(unit + ".vrt"), changed);
    return run_emit({"scene", "terrain", folder.file(unit + ".vrt"), "--out", folder.file("u"),
                     "--cell-m", "500"});
  };
  const ProcessResult feet = with_unit("ft");
  ASSERT_EQ(feet.exit_code, 0) << feet.err;
  EXPECT_NE(feet.out.find("in international feet;"), std::string::npos) << feet.out;
  EXPECT_NEAR(origin_of(folder.file("u/ft.toml")).height.value(), 304.8, 1e-3);
  const ProcessResult unknown = with_unit("fathom");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_NE(unknown.err.find("the unit 'fathom'"), std::string::npos) << unknown.err;
}

TEST(CliTerrain, what_a_raster_lacks_is_named) {
  NEEDS_GDAL();
  const TemporaryFolder folder;
  // A pond without data in the north-east, and a lake of a number that nobody declares.
  const auto value = [](double lon, double lat) {
    return lon > 11.07 && lon < 11.08 && lat > 47.05 && lat < 47.06 ? -9999.0 : 50.0;
  };
  write_raster(folder.file("d.tif"), {}, value);
  const auto run = [&](std::vector<std::string> more, const std::string& out) {
    std::vector<std::string> call{"scene", "terrain", folder.file("d.tif"), "--out",
                                  folder.file(out)};
    call.insert(call.end(), more.begin(), more.end());
    return run_emit(call);
  };
  const ProcessResult hole = run({}, "hole");
  EXPECT_EQ(hole.exit_code, 0) << hole.err;
  EXPECT_NE(hole.err.find("have no data, the nearest 1."), std::string::npos) << hole.err;
  const ProcessResult filled = run({"--fill-m", "49"}, "filled");
  EXPECT_EQ(filled.exit_code, 0);
  EXPECT_NE(filled.err.find("they get the height 49 m"), std::string::npos) << filled.err;
  const ProcessResult wide = run({"--radius-km", "6"}, "wide");
  EXPECT_EQ(wide.exit_code, 0);
  EXPECT_NE(wide.err.find("--radius-km ends it before"), std::string::npos) << wide.err;
  const ProcessResult outside = run({"--lat-deg", "48", "--lon-deg", "11"}, "outside");
  EXPECT_EQ(outside.exit_code, 2);
  EXPECT_NE(outside.err.find("lies outside the raster"), std::string::npos) << outside.err;
  const ProcessResult pond = run({"--lat-deg", "47.055", "--lon-deg", "11.075"}, "pond");
  EXPECT_EQ(pond.exit_code, 2);
  EXPECT_NE(pond.err.find("no data at the place"), std::string::npos) << pond.err;
  const ProcessResult huge = run({"--cell-m", "0.1"}, "huge");
  EXPECT_EQ(huge.exit_code, 2);
  EXPECT_NE(huge.err.find("8192 is the most"), std::string::npos) << huge.err;

  write_raster(folder.file("u.tif"), {.more = {"-a_nodata", "none"}}, value);
  const ProcessResult impossible =
      run_emit({"scene", "terrain", folder.file("u.tif"), "--out", folder.file("u")});
  EXPECT_EQ(impossible.exit_code, 1);
  EXPECT_NE(impossible.err.find("--no-data names it"), std::string::npos) << impossible.err;
  EXPECT_EQ(run_emit({"scene", "terrain", folder.file("u.tif"), "--out", folder.file("u"),
                      "--no-data", "-9999"})
                .exit_code,
            0);
  const ProcessResult none =
      run_emit({"scene", "terrain", folder.file("none.tif"), "--out", folder.file("n")});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.err.find("none.tif: gdalinfo ended with exit code 1"), std::string::npos)
      << none.err;
  const ProcessResult placeless =
      run_emit({"scene", "terrain", folder.file("d.tif.asc"), "--out", folder.file("n")});
  EXPECT_EQ(placeless.exit_code, 1);
  EXPECT_NE(placeless.err.find("names no coordinate system"), std::string::npos) << placeless.err;
  // Work files do not stay behind.
  for (const auto& entry : std::filesystem::directory_iterator(folder.file("hole"))) {
    EXPECT_TRUE(entry.path().extension() == ".glb" || entry.path().extension() == ".toml")
        << entry.path();
  }
}

TEST(CliTerrain, land_cover_chooses_materials_and_unknown_classes_are_counted) {
  NEEDS_GDAL();
  const TemporaryFolder folder;
  write_raster(folder.file("d.tif"), {}, [](double, double) { return 50.0; });
  write_raster(folder.file("c.tif"), {}, [](double lon, double lat) {
    return lat > 47.09 && lon > 11.09 ? 7.0 : lon < 11.05 ? 3.0 : 5.0;
  });
  write_text(folder.file("c.csv"), "class,material\n3,grass\n5,sand\n");
  const auto run = [&](const std::string& out, std::vector<std::string> more) {
    std::vector<std::string> call{"scene",
                                  "terrain",
                                  folder.file("d.tif"),
                                  "--out",
                                  folder.file(out),
                                  "--land-cover",
                                  folder.file("c.tif"),
                                  "--classes",
                                  folder.file("c.csv")};
    call.insert(call.end(), more.begin(), more.end());
    return run_emit(call);
  };
  ASSERT_EQ(run("good", {}).exit_code, 0);
  const auto model = scene::import_gltf(folder.file("good/d.glb"));
  ASSERT_TRUE(model) << model.error().text;
  std::vector<std::string> names;
  for (const auto& material : model->materials) names.push_back(material.name);
  std::ranges::sort(names);
  EXPECT_EQ(names, (std::vector<std::string>{"grass", "sand"}));
  const ProcessResult unknown = run("bad", {"--radius-km", "5.5"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_NE(unknown.err.find("no material for the classes 7 ("), std::string::npos) << unknown.err;
  write_text(folder.file("c.csv"), "class,material\n3,gras\n");
  const ProcessResult misspelt = run("bad", {});
  EXPECT_EQ(misspelt.exit_code, 1);
  EXPECT_NE(misspelt.err.find("c.csv:2: the library has no material 'gras'"), std::string::npos)
      << misspelt.err;
  EXPECT_EQ(run_emit({"scene", "terrain", folder.file("d.tif"), "--out", folder.file("x"),
                      "--land-cover", folder.file("c.tif")})
                .exit_code,
            2);
}

/// The sea ends at the dip of the horizon, sqrt(2 h / R), in the picture that emit renders.
TEST(CliTerrain, the_rendered_horizon_dips_by_the_curvature_of_the_earth) {
  NEEDS_GDAL();
  const TemporaryFolder folder;
  write_raster(folder.file("sea.tif"),
               {.columns = 141, .rows = 101, .west = 10.0, .south = 46.5, .cell = 0.01},
               [](double, double) { return 0.0; });
  ASSERT_EQ(run_emit({"scene", "terrain", folder.file("sea.tif"), "--out", folder.file("o"),
                      "--error-m", "0.2", "--error-mrad", "0.02"})
                .exit_code,
            0);
  constexpr double kFovDeg = 0.2;
  constexpr double kWidthPx = 32.0;
  constexpr double kEyeM = 100.0;
  const ProcessResult rendered = run_emit(
      {"render", folder.file("o/sea.toml"), "--quality", "preview", "--time-s", "0", "--out",
       folder.file("f.exr"), "--set", "sensor.fov_h_deg=0.2", "--set", "sensor.width_px=32",
       "--set", "sensor.height_px=512", "--set", "sensor.look_at_m=[0,1000,100]"},
      std::chrono::seconds(300));
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  const auto image = image::read_exr(folder.file("f.exr"));
  ASSERT_TRUE(image) << image.error().text;
  const image::ExrChannel* depth_m = image->find("depth");
  ASSERT_NE(depth_m, nullptr);
  const std::uint32_t column = image->width_px / 2;
  std::uint32_t row = 0;
  while (row < image->height_px &&
         !std::isfinite(depth_m->pixels[row * image->width_px + column])) {
    ++row;
  }
  ASSERT_LT(row, image->height_px);
  const double pixel_rad = kFovDeg * physics::kDegree / kWidthPx;
  const double horizon_rad = (0.5 * image->height_px - row) * pixel_rad;
  // The radius of curvature of the meridian at 47 degrees.
  constexpr double kRadiusM = 6.3697e6;
  EXPECT_NEAR(horizon_rad, -std::sqrt(2.0 * kEyeM / kRadiusM), 1e-4 + 0.5 * pixel_rad);
  const double seen_m = static_cast<double>(depth_m->pixels[row * image->width_px + column]);
  EXPECT_NEAR(seen_m, std::sqrt(2.0 * kEyeM * kRadiusM), 7000.0);
}

TEST(CliTerrain, a_missing_gdal_is_named_with_its_package) {
  const TemporaryFolder folder;
  const ProcessResult result = run_process({"/usr/bin/env", "PATH=" + folder.path().string(),
                                            std::string(EMIT_TEST_BIN_DIR) + "/emit", "scene",
                                            "terrain", "d.tif", "--out", folder.file("o")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("apt-get install gdal-bin"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace emit::test
