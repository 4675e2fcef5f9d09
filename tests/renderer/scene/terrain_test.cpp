// SPDX-License-Identifier: Apache-2.0
#include "emit/scenegen/terrain.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/scene/gltf_import.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::scenegen {
namespace {

using physics::degrees;
using physics::GeoPlace;
using physics::Metres;

constexpr double kLatitudeDeg = 47.0;

/// Height above the ellipsoid of a point of the plane of the horizon.
using HeightField = std::function<double(double east_m, double north_m)>;

HeightGrid grid_of(std::uint32_t cells, double spacing_m, const HeightField& height_m) {
  HeightGrid grid;
  grid.cells = cells;
  grid.spacing_m = spacing_m;
  for (std::size_t y = 0; y < grid.points(); ++y) {
    for (std::size_t x = 0; x < grid.points(); ++x) {
      grid.height_m.push_back(static_cast<float>(height_m(grid.offset_m(x), grid.offset_m(y))));
    }
  }
  const auto middle = static_cast<double>(grid.height_m[grid.index(cells / 2, cells / 2)]);
  grid.place = {degrees(kLatitudeDeg), degrees(11.0), Metres(std::isfinite(middle) ? middle : 0.0)};
  return grid;
}

using Corners = std::array<glm::dvec3, 3>;

std::vector<Corners> triangles_of(const Terrain& terrain) {
  std::vector<Corners> out;
  for (const TerrainTile& tile : terrain.tiles) {
    for (const TerrainPart& part : tile.parts) {
      for (std::size_t i = 0; i < part.indices.size(); i += 3) {
        Corners corners;
        for (std::size_t k = 0; k < 3; ++k) {
          corners[k] = tile.origin_world_m + glm::dvec3(part.positions_m[part.indices[i + k]]);
        }
        out.push_back(corners);
      }
    }
  }
  return out;
}

/// Hills of all sizes, with noise from cell to cell.
double rough_m(double east_m, double north_m) {
  const double hills = 300.0 * std::sin(east_m / 2100.0) * std::cos(north_m / 1700.0) +
                       60.0 * std::sin((east_m + 0.3 * north_m) / 310.0);
  const double noise = std::sin(12.9898 * east_m + 78.233 * north_m) * 43758.5453;
  return 500.0 + hills + 4.0 * (noise - std::floor(noise));
}

TEST(Terrain, vertical_errors_are_within_the_bound_at_every_point_of_the_grid) {
  const HeightGrid grid = grid_of(256, 60.0, rough_m);
  const TerrainOptions options{.radius_m = 1e5, .error_m = 3.0, .error_rad = 2e-3};
  const auto terrain = triangulate_terrain(grid, {}, options);
  ASSERT_TRUE(terrain) << terrain.error().text;
  EXPECT_LT(terrain->triangles, 2U * 256U * 256U / 3U);  // far fewer than the cells give
  const glm::dmat3 world_from_ecef = glm::transpose(physics::ecef_from_enu(grid.place));
  const glm::dvec3 origin_ecef_m = physics::ecef_m(grid.place);
  // A vertical line through each point meets a triangle at the error.
  std::vector<double> errors_m(grid.height_m.size(), std::numeric_limits<double>::infinity());
  for (const Corners& t : triangles_of(*terrain)) {
    const glm::dvec3 lo = glm::min(t[0], glm::min(t[1], t[2]));
    const glm::dvec3 hi = glm::max(t[0], glm::max(t[1], t[2]));
    const auto first = [&](double at_m) {
      return static_cast<std::size_t>(std::clamp(at_m / grid.spacing_m + 128.0 - 2.0, 0.0, 256.0));
    };
    for (std::size_t y = first(lo.y); y <= std::min<std::size_t>(256, first(hi.y) + 4); ++y) {
      for (std::size_t x = first(lo.x); x <= std::min<std::size_t>(256, first(hi.x) + 4); ++x) {
        // The point is placed by way of latitude and longitude.
        const double height_m = static_cast<double>(grid.height_m[grid.index(x, y)]);
        const auto foot = physics::HorizonPlane(grid.place)
                              .ellipsoid_point(Metres(grid.offset_m(x)), Metres(grid.offset_m(y)));
        GeoPlace place = physics::place_at_ecef(foot->position_ecef_m);
        place.height = Metres(height_m);
        const glm::dvec3 p = world_from_ecef * (physics::ecef_m(place) - origin_ecef_m);
        const glm::dvec3 up = world_from_ecef * physics::ecef_from_enu(place)[2];
        const glm::dmat3 system(t[1] - t[0], t[2] - t[0], up);
        const glm::dvec3 solution = glm::inverse(system) * (p - t[0]);
        constexpr double kEdge = 1e-4;  // vertices are rounded to a millimetre
        if (solution.x < -kEdge || solution.y < -kEdge || solution.x + solution.y > 1.0 + kEdge) {
          continue;
        }
        double& error_m = errors_m[grid.index(x, y)];
        error_m = std::min(error_m, std::abs(solution.z));
      }
    }
  }
  double worst = 0.0;
  for (std::size_t y = 0; y < grid.points(); ++y) {
    for (std::size_t x = 0; x < grid.points(); ++x) {
      const double distance_m = std::hypot(grid.offset_m(x), grid.offset_m(y));
      const double allowed_m = std::max(options.error_m, options.error_rad * distance_m);
      ASSERT_LE(errors_m[grid.index(x, y)], allowed_m) << x << ' ' << y;
      worst = std::max(worst, errors_m[grid.index(x, y)] / allowed_m);
    }
  }
  EXPECT_GT(worst, 0.8);  // the bound is used
}

/// Elevation angles along an azimuth: distance and height above the eye's horizontal plane of the
/// points where edges of the mesh cross the vertical half-plane.
std::vector<std::pair<double, double>> profile(const std::vector<Corners>& triangles,
                                               const glm::dvec3& eye_m, double azimuth_rad) {
  const glm::dvec2 along(std::sin(azimuth_rad), std::cos(azimuth_rad));
  std::vector<std::pair<double, double>> out;
  for (const Corners& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 p = t[k] - eye_m;
      const glm::dvec3 q = t[(k + 1) % 3] - eye_m;
      const double side_p = p.x * along.y - p.y * along.x;
      const double side_q = q.x * along.y - q.y * along.x;
      if ((side_p < 0.0) == (side_q < 0.0)) continue;
      const glm::dvec3 at = p + (q - p) * (side_p / (side_p - side_q));
      const double distance_m = at.x * along.x + at.y * along.y;
      if (distance_m > 1.0) out.emplace_back(distance_m, at.z);
    }
  }
  std::ranges::sort(out);
  return out;
}

/// Radius of curvature of the ellipsoid in an azimuth (Euler's formula).
double radius_of_curvature_m(double azimuth_rad) {
  constexpr double kE2 = physics::kWgs84Flattening * (2.0 - physics::kWgs84Flattening);
  const double s = std::sin(kLatitudeDeg * physics::kDegree);
  const double w2 = 1.0 - kE2 * s * s;
  const double prime_m = physics::kWgs84SemiMajorM / std::sqrt(w2);
  const double meridian_m = prime_m * (1.0 - kE2) / w2;
  return 1.0 / (std::pow(std::cos(azimuth_rad), 2) / meridian_m +
                std::pow(std::sin(azimuth_rad), 2) / prime_m);
}

constexpr TerrainOptions kFine{.radius_m = 1e5, .error_m = 0.2, .error_rad = 2e-5};

TEST(Terrain, the_horizon_of_the_sea_dips_by_the_curvature_of_the_ellipsoid) {
  const auto terrain =
      triangulate_terrain(grid_of(1024, 100.0, [](double, double) { return 0.0; }), {}, kFine);
  ASSERT_TRUE(terrain) << terrain.error().text;
  const std::vector<Corners> triangles = triangles_of(*terrain);
  for (const double eye_m : {10.0, 50.0, 150.0}) {
    for (const double azimuth_rad : {0.1, 0.9, 1.6, 2.9, 4.0, 5.5}) {
      double highest_rad = -1.0;
      double at_m = 0.0;
      for (const auto& [distance_m, up_m] : profile(triangles, {0, 0, eye_m}, azimuth_rad)) {
        const double elevation_rad = std::atan2(up_m, distance_m);
        if (elevation_rad > highest_rad) {
          highest_rad = elevation_rad;
          at_m = distance_m;
        }
      }
      const double radius_m = radius_of_curvature_m(azimuth_rad);
      EXPECT_NEAR(highest_rad, -std::sqrt(2.0 * eye_m / radius_m), 1e-4) << eye_m;
      // The angle changes so little near the horizon that 1e-4 rad leaves this much of distance.
      const double horizon_m = std::sqrt(2.0 * eye_m * radius_m);
      EXPECT_NEAR(at_m, horizon_m, std::sqrt(1e-4 * std::pow(horizon_m, 3) / eye_m)) << eye_m;
    }
  }
}

TEST(Terrain, a_mountain_behind_the_horizon_shows_what_curvature_does_not_hide) {
  constexpr double kAwayM = 30e3;
  constexpr double kPeakM = 1000.0;
  constexpr double kFootM = 3e3;
  for (const double azimuth_rad : {0.0, 0.7, 1.5707963, 3.9}) {
    // The peak is a point of the grid or near one; the profile is taken through the axis.
    const double east_m = std::round(kAwayM * std::sin(azimuth_rad) / 100.0) * 100.0;
    const double north_m = std::round(kAwayM * std::cos(azimuth_rad) / 100.0) * 100.0;
    const auto cone_m = [&](double e, double n) {
      return kPeakM * std::max(0.0, 1.0 - std::hypot(e - east_m, n - north_m) / kFootM);
    };
    const auto terrain = triangulate_terrain(grid_of(1024, 100.0, cone_m), {}, kFine);
    ASSERT_TRUE(terrain) << terrain.error().text;
    const double eye_m = 10.0;
    const double away_m = std::hypot(east_m, north_m);
    const double radius_m = radius_of_curvature_m(azimuth_rad);
    const auto points = profile(triangles_of(*terrain), {0, 0, eye_m}, std::atan2(east_m, north_m));
    double peak_rad = -1.0;
    for (const auto& [distance_m, up_m] : points) {
      peak_rad = std::max(peak_rad, std::atan2(up_m, distance_m));
    }
    EXPECT_NEAR(peak_rad, std::atan((kPeakM - eye_m - away_m * away_m / (2.0 * radius_m)) / away_m),
                1e-4);
    // The line of sight that touches the sea meets the flank where its height is the hidden one.
    const double dip_rad = std::sqrt(2.0 * eye_m / radius_m);
    const double horizon_m = std::sqrt(2.0 * eye_m * radius_m);
    double lowest_seen_m = -1.0;
    double hidden_m = 0.0;
    for (std::size_t i = 1; i < points.size() && lowest_seen_m < 0.0; ++i) {
      if (points[i].first < horizon_m + 5e3) continue;
      const double before = points[i - 1].second + dip_rad * points[i - 1].first;
      const double after = points[i].second + dip_rad * points[i].first;
      if (before > 0.0 || after <= 0.0) continue;
      const double at_m =
          points[i - 1].first + (points[i].first - points[i - 1].first) * before / (before - after);
      hidden_m = std::pow(at_m - horizon_m, 2) / (2.0 * radius_m);
      lowest_seen_m = kPeakM * (1.0 - (away_m - at_m) / kFootM);
    }
    ASSERT_GT(lowest_seen_m, 0.0);
    EXPECT_GT(hidden_m, 15.0);
    EXPECT_NEAR(lowest_seen_m, hidden_m, 1e-4 * away_m);
  }
}

using Point = std::array<double, 3>;

/// Triangles of a glTF file at their places, in the axes of the world.
std::vector<std::array<Point, 3>> imported(const std::filesystem::path& file) {
  std::vector<std::array<Point, 3>> out;
  const auto model = scene::import_gltf(file);
  EXPECT_TRUE(model) << model.error().text;
  if (!model) return out;
  EXPECT_TRUE(model->warnings.empty()) << model->warnings.front();
  for (const scene::GltfPlacement& placement : model->placements) {
    const scene::Mesh& mesh = model->meshes[placement.mesh];
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
      std::array<Point, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        const glm::dvec4 p = placement.gltf_from_mesh *
                             glm::dvec4(glm::dvec3(mesh.positions_m[mesh.indices[i + k]]), 1.0);
        triangle[k] = {-p.x, p.z, p.y};  // glTF: x west, y up, z north
      }
      out.push_back(triangle);
    }
  }
  return out;
}

/// Edges that only one triangle has.
std::vector<std::pair<Point, Point>> open_edges(
    const std::vector<std::array<Point, 3>>& triangles) {
  std::map<std::pair<Point, Point>, int> sum;  // of directions: 0 where two triangles meet
  for (const auto& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Point& p = t[k];
      const Point& q = t[(k + 1) % 3];
      if (p < q) {
        ++sum[{p, q}];
      } else {
        --sum[{q, p}];
      }
    }
  }
  std::vector<std::pair<Point, Point>> out;
  for (const auto& [edge, count] : sum) {
    EXPECT_LE(std::abs(count), 1);
    if (count != 0) out.push_back(edge);
  }
  return out;
}

Point rounded_point(const HeightGrid& grid, std::size_t x, std::size_t y) {
  const glm::dvec3 p = terrain_point_m(grid.place, grid.offset_m(x), grid.offset_m(y),
                                       static_cast<double>(grid.height_m[grid.index(x, y)]));
  const glm::dvec3 steps = glm::round(p / kTerrainStepM) * kTerrainStepM;
  return {steps.x + 0.0, steps.y + 0.0, steps.z + 0.0};
}

std::filesystem::path scratch_file(const std::string& name) {
  return std::filesystem::path(testing::TempDir()) / name;
}

TEST(Terrain, edges_are_shared_within_and_across_tiles_to_the_bit) {
  const HeightGrid grid = grid_of(512, 80.0, rough_m);
  const auto terrain = triangulate_terrain(
      grid, {}, {.radius_m = 1e5, .error_m = 2.0, .error_rad = 1e-3, .max_tile_triangles = 5000});
  ASSERT_TRUE(terrain) << terrain.error().text;
  EXPECT_GT(terrain->tiles.size(), 20U);
  const std::vector<std::string> names{"soil"};
  const auto file = scratch_file("emit_terrain_edges.glb");
  const auto written = write_terrain(file, *terrain, names);
  ASSERT_TRUE(written) << written.error().text;
  const auto triangles = imported(file);
  std::filesystem::remove(file);
  EXPECT_EQ(triangles.size(), terrain->triangles);
  std::set<Point> rim;
  for (std::size_t i = 0; i <= 512; ++i) {
    for (const auto& [x, y] :
         {std::pair<std::size_t, std::size_t>{i, 0}, {i, 512}, {0, i}, {512, i}}) {
      rim.insert(rounded_point(grid, x, y));
    }
  }
  const auto open = open_edges(triangles);
  EXPECT_GE(open.size(), 8U);
  for (const auto& [p, q] : open) {
    ASSERT_TRUE(rim.contains(p) && rim.contains(q)) << p[0] << ' ' << p[1];
  }
  // Fronts look up.
  for (const auto& t : triangles) {
    ASSERT_GT((t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[1][1] - t[0][1]) * (t[2][0] - t[0][0]),
              0.0);
  }
}

TEST(Terrain, tiles_have_at_most_the_wanted_triangles_and_float32_holds_them) {
  const auto terrain = triangulate_terrain(
      grid_of(512, 80.0, rough_m), {},
      {.radius_m = 1e5, .error_m = 0.5, .error_rad = 1e-4, .max_tile_triangles = 20000});
  ASSERT_TRUE(terrain) << terrain.error().text;
  std::uint64_t sum = 0;
  for (const TerrainTile& tile : terrain->tiles) {
    std::size_t triangles = 0;
    for (const TerrainPart& part : tile.parts) {
      triangles += part.indices.size() / 3;
      for (const glm::vec3& p : part.positions_m) {
        ASSERT_LT(std::max(std::abs(p.x), std::abs(p.y)), 8192.0F);
      }
    }
    EXPECT_LE(triangles, 20000U);
    sum += triangles;
  }
  EXPECT_EQ(sum, terrain->triangles);
  EXPECT_GT(sum, 200'000U);
}

TEST(Terrain, ground_ends_at_points_without_data_and_at_the_radius) {
  constexpr double kHoleM = 1000.0;
  const auto hole_m = [](double east_m, double north_m) {
    return std::hypot(east_m - 3000.0, north_m) < kHoleM ? std::numeric_limits<double>::quiet_NaN()
                                                         : 10.0;
  };
  const HeightGrid grid = grid_of(256, 100.0, hole_m);
  const auto terrain =
      triangulate_terrain(grid, {}, {.radius_m = 8000.0, .error_m = 1.0, .error_rad = 1e-3});
  ASSERT_TRUE(terrain) << terrain.error().text;
  double plan_m2 = 0.0;
  for (const Corners& t : triangles_of(*terrain)) {
    const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0;
    EXPECT_GT(std::hypot(middle.x - 3000.0, middle.y), kHoleM - 150.0);
    const glm::dvec3 nearest = glm::clamp(glm::dvec3(0.0), glm::min(t[0], glm::min(t[1], t[2])),
                                          glm::max(t[0], glm::max(t[1], t[2])));
    EXPECT_LT(std::hypot(nearest.x, nearest.y), 8000.1);
    plan_m2 += 0.5 * glm::cross(t[1] - t[0], t[2] - t[0]).z;
  }
  EXPECT_GT(plan_m2, physics::kPi * (8000.0 * 8000.0 - 1150.0 * 1150.0));
  EXPECT_LT(plan_m2, 0.9 * 25'600.0 * 25'600.0);  // corners of the grid are left out
}

TEST(Terrain, materials_meet_where_the_cells_do) {
  const HeightGrid grid = grid_of(128, 50.0, [](double, double) { return 0.0; });
  std::vector<std::uint8_t> material(grid.height_m.size());
  for (std::size_t y = 0; y < grid.points(); ++y) {
    for (std::size_t x = 0; x < grid.points(); ++x) {
      material[grid.index(x, y)] = grid.offset_m(x) < 777.0 ? 0 : 1;
    }
  }
  const auto terrain = triangulate_terrain(grid, material, {.radius_m = 1e5, .cover_rad = 0.0});
  ASSERT_TRUE(terrain) << terrain.error().text;
  std::size_t seen = 0;
  for (const TerrainTile& tile : terrain->tiles) {
    for (const TerrainPart& part : tile.parts) {
      for (std::size_t i = 0; i < part.indices.size(); i += 3) {
        double east_m = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
          east_m += (tile.origin_world_m.x +
                     static_cast<double>(part.positions_m[part.indices[i + k]].x)) /
                    3.0;
        }
        // A triangle lies by at most a cell on the other side of the border.
        const double beyond_m = part.material == 0 ? east_m - 777.0 : 777.0 - east_m;
        EXPECT_LT(beyond_m, 50.0);
        ++seen;
      }
    }
  }
  EXPECT_EQ(seen, terrain->triangles);
  // Wide borders cost fewer triangles.
  const auto coarse = triangulate_terrain(grid, material, {.radius_m = 1e5, .cover_rad = 0.5});
  ASSERT_TRUE(coarse);
  EXPECT_LT(coarse->triangles, terrain->triangles / 2);
}

TEST(Terrain, values_out_of_range_are_named) {
  const HeightGrid good = grid_of(4, 10.0, [](double, double) { return 0.0; });
  const auto text = [](const HeightGrid& grid, const TerrainOptions& options) {
    const auto terrain = triangulate_terrain(grid, {}, options);
    return terrain ? std::string() : terrain.error().text;
  };
  HeightGrid wrong = good;
  wrong.cells = 6;
  EXPECT_NE(text(wrong, {.radius_m = 20.0}).find("cells = 6"), std::string::npos);
  wrong = good;
  wrong.height_m.pop_back();
  EXPECT_NE(text(wrong, {.radius_m = 20.0}).find("height_m.size() = 24"), std::string::npos);
  EXPECT_NE(text(good, {}).find("radius_m = 0"), std::string::npos);
  EXPECT_NE(text(good, {.radius_m = 20.0, .error_m = 0.0}).find("error_m = 0"), std::string::npos);
  EXPECT_EQ(text(good, {.radius_m = 20.0}), "");
}

}  // namespace
}  // namespace emit::scenegen
