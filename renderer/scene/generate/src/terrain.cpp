// SPDX-License-Identifier: Apache-2.0
#include "emit/scenegen/terrain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <unordered_map>
#include <utility>

#include "emit/physics/check.hpp"
#include "glb_writer.hpp"

namespace emit::scenegen {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr float kNever = std::numeric_limits<float>::infinity();
/// Positions of a tile from its origin stay below 2^24 steps, which float32 holds exactly.
constexpr double kMaxTileM = 8192.0;
/// Share of the error that is left for the rounding of vertices and for the vertical, which is
/// taken in the middle of each triangle.
constexpr double kErrorShare = 0.98;

/// Converts points of the plane of the horizon to the world.
class WorldPoints {
 public:
  explicit WorldPoints(const physics::GeoPlace& place)
      : plane_(place),
        origin_ecef_m_(physics::ecef_m(place)),
        world_from_ecef_(glm::transpose(physics::ecef_from_enu(place))) {}

  [[nodiscard]] glm::dvec3 point_m(double east_m, double north_m, double height_m) const {
    const auto foot = plane_.ellipsoid_point(physics::Metres(east_m), physics::Metres(north_m));
    EMIT_CHECK(foot.has_value());
    return world_from_ecef_ * (foot->position_ecef_m + height_m * foot->up_ecef - origin_ecef_m_);
  }
  [[nodiscard]] glm::dvec3 up(double east_m, double north_m) const {
    const auto foot = plane_.ellipsoid_point(physics::Metres(east_m), physics::Metres(north_m));
    EMIT_CHECK(foot.has_value());
    return world_from_ecef_ * foot->up_ecef;
  }

 private:
  physics::HorizonPlane plane_;
  glm::dvec3 origin_ecef_m_;
  glm::dmat3 world_from_ecef_;
};

/// A point of the grid.
struct Node {
  int x = 0;
  int y = 0;
};

/// A right triangle of the network. Its hypotenuse goes from a to b, its right angle is at c.
struct Triangle {
  Node a;
  Node b;
  Node c;

  [[nodiscard]] Node middle() const { return {(a.x + b.x) / 2, (a.y + b.y) / 2}; }
  [[nodiscard]] bool divisible() const {
    return std::max(std::abs(a.x - b.x), std::abs(a.y - b.y)) >= 2;
  }
};

class Network {
 public:
  Network(const HeightGrid& grid, std::span<const std::uint8_t> material,
          const TerrainOptions& options)
      : grid_(grid),
        material_(material),
        options_(options),
        world_(grid.place),
        size_(static_cast<int>(grid.cells)) {
    place_points();
    find_errors();
  }

  [[nodiscard]] std::vector<Triangle> triangles() const {
    std::vector<Triangle> out;
    const Node south_west{0, 0};
    const Node north_east{size_, size_};
    add({north_east, south_west, {size_, 0}}, out);
    add({south_west, north_east, {0, size_}}, out);
    return out;
  }

 private:
  [[nodiscard]] std::size_t index(Node node) const {
    return grid_.index(static_cast<std::size_t>(node.x), static_cast<std::size_t>(node.y));
  }
  [[nodiscard]] bool inside(Node node) const {
    return node.x >= 0 && node.y >= 0 && node.x <= size_ && node.y <= size_;
  }
  [[nodiscard]] double offset_m(int column_or_row) const {
    return grid_.offset_m(static_cast<std::size_t>(column_or_row));
  }

  void place_points() {
    points_m_.resize(grid_.height_m.size());
    for (int y = 0; y <= size_; ++y) {
      for (int x = 0; x <= size_; ++x) {
        const std::size_t i = index({x, y});
        const double height_m = static_cast<double>(grid_.height_m[i]);
        points_m_[i] = std::isfinite(height_m)
                           ? glm::vec3(world_.point_m(offset_m(x), offset_m(y), height_m))
                           : glm::vec3(kNever);
      }
    }
  }

  [[nodiscard]] bool valid(std::size_t i) const { return std::isfinite(grid_.height_m[i]); }

  /// True if no part of the triangle's box lies within the radius.
  [[nodiscard]] bool beyond(const Triangle& t) const {
    const auto nearest = [&](int p, int q, int r) {
      const double lo = offset_m(std::min({p, q, r}));
      const double hi = offset_m(std::max({p, q, r}));
      return lo > 0.0 ? lo : hi < 0.0 ? hi : 0.0;
    };
    return std::hypot(nearest(t.a.x, t.b.x, t.c.x), nearest(t.a.y, t.b.y, t.c.y)) >
           options_.radius_m;
  }

  /// Largest error of the points of a triangle over the error that they may have.
  [[nodiscard]] float error_of(const Triangle& t) const {
    if (beyond(t)) return 0.0F;
    const std::array<Node, 3> corners{t.a, t.b, t.c};
    const int leg = std::max(std::abs(t.a.x - t.c.x), std::abs(t.a.y - t.c.y));
    // A triangle fits into a tile.
    if (grid_.spacing_m * leg > kMaxTileM) return kNever;
    const std::size_t ia = index(t.a);
    const bool first_valid = valid(ia);
    const glm::dvec3 a(points_m_[ia]);
    glm::dvec3 slope(0.0);
    const double middle_east_m = offset_m(t.middle().x);
    const double middle_north_m = offset_m(t.middle().y);
    if (first_valid) {
      const glm::dvec3 normal =
          glm::cross(glm::dvec3(points_m_[index(t.b)]) - a, glm::dvec3(points_m_[index(t.c)]) - a);
      slope = normal / glm::dot(normal, world_.up(middle_east_m, middle_north_m));
    }
    const std::uint8_t first_material = material_.empty() ? std::uint8_t{0} : material_[ia];
    bool mixed = false;
    double worst = 0.0;
    const int y0 = std::min({t.a.y, t.b.y, t.c.y});
    const int y1 = std::max({t.a.y, t.b.y, t.c.y});
    for (int y = y0; y <= y1; ++y) {
      // Edges are level, upright or diagonal, so that they meet the rows in points of the grid.
      int x0 = std::numeric_limits<int>::max();
      int x1 = std::numeric_limits<int>::min();
      for (std::size_t k = 0; k < 3; ++k) {
        const Node& p = corners[k];
        const Node& q = corners[(k + 1) % 3];
        if (y < std::min(p.y, q.y) || y > std::max(p.y, q.y)) continue;
        const int x = p.y == q.y ? p.x : p.x + (q.x - p.x) * (y - p.y) / (q.y - p.y);
        x0 = std::min({x0, x, p.y == q.y ? q.x : x});
        x1 = std::max({x1, x, p.y == q.y ? q.x : x});
      }
      const double north_m = offset_m(y);
      std::size_t i = index({x0, y});
      for (int x = x0; x <= x1; ++x, ++i) {
        if (valid(i) != first_valid) return kNever;
        if (!first_valid) continue;
        mixed = mixed || (!material_.empty() && material_[i] != first_material);
        const double error_m = std::abs(glm::dot(slope, glm::dvec3(points_m_[i]) - a));
        const double east_m = offset_m(x);
        worst =
            std::max(worst, error_m / allowed_m(std::sqrt(east_m * east_m + north_m * north_m)));
      }
      if (worst > 1.0) break;
    }
    if (mixed && grid_.spacing_m * leg >
                     std::max(grid_.spacing_m,
                              options_.cover_rad * std::hypot(middle_east_m, middle_north_m))) {
      return kNever;
    }
    return static_cast<float>(worst);
  }

  /// Error that points at a distance may have here: less than is promised by the rounding of
  /// vertices and of points_m_.
  [[nodiscard]] double allowed_m(double distance_m) const {
    const double promised_m = std::max(options_.error_m, options_.error_rad * distance_m);
    const double rounding_m = 2.0 * kTerrainStepM + 1e-7 * distance_m;
    return std::max(promised_m * kErrorShare - rounding_m, 1e-6);
  }

  /// Measures the two triangles that a vertex divides, unless it is needed anyway, and makes its
  /// parents, without which it cannot be, at least as large.
  void find_error(Node middle, Node along, Node parent_a, Node parent_b) {
    float& error = errors_[index(middle)];
    const Node a{middle.x - along.x, middle.y - along.y};
    const Node b{middle.x + along.x, middle.y + along.y};
    for (const Node apex : {parent_a, parent_b}) {
      if (inside(apex) && error <= 1.0F) error = std::max(error, error_of({a, b, apex}));
    }
    for (const Node apex : {parent_a, parent_b}) {
      if (!inside(apex)) continue;
      float& parent = errors_[index(apex)];
      parent = std::max(parent, error);
    }
  }

  void find_errors() {
    errors_.assign(grid_.height_m.size(), 0.0F);
    for (int s = 1; s < size_; s *= 2) {
      // Vertices that divide level and upright edges of length 2 s.
      for (int y = 0; y <= size_; y += s) {
        const bool odd_row = (y / s) % 2 != 0;
        for (int x = odd_row ? 0 : s; x <= size_; x += 2 * s) {
          if (odd_row) {
            find_error({x, y}, {0, s}, {x - s, y}, {x + s, y});
          } else {
            find_error({x, y}, {s, 0}, {x, y - s}, {x, y + s});
          }
        }
      }
      // Vertices in the middle of squares of edge 2 s. Diagonals lead to the middle of the square
      // of twice the edge.
      for (int y = s; y < size_; y += 2 * s) {
        for (int x = s; x < size_; x += 2 * s) {
          const bool rising = (x / (2 * s) + y / (2 * s)) % 2 == 0;
          if (rising) {
            find_error({x, y}, {s, s}, {x + s, y - s}, {x - s, y + s});
          } else {
            find_error({x, y}, {s, -s}, {x + s, y + s}, {x - s, y - s});
          }
        }
      }
    }
  }

  void add(const Triangle& t, std::vector<Triangle>& out) const {
    if (t.divisible() && errors_[index(t.middle())] > 1.0F) {
      add({t.c, t.a, t.middle()}, out);
      add({t.b, t.c, t.middle()}, out);
    } else if (valid(index(t.a)) && valid(index(t.b)) && valid(index(t.c)) && !beyond(t)) {
      out.push_back(t);
    }
  }

  const HeightGrid& grid_;
  std::span<const std::uint8_t> material_;
  const TerrainOptions& options_;
  WorldPoints world_;
  int size_;
  std::vector<glm::vec3> points_m_;
  std::vector<float> errors_;  ///< by dividing vertex
};

/// Vertices in use, with the normals of the triangles around them.
class Vertices {
 public:
  Vertices(const HeightGrid& grid, std::span<const Triangle> triangles) : grid_(grid) {
    const WorldPoints world(grid.place);
    numbers_.assign(grid.height_m.size(), kUnused);
    for (const Triangle& t : triangles) {
      for (const Node node : {t.a, t.b, t.c}) {
        std::uint32_t& number = numbers_[index(node)];
        if (number != kUnused) continue;
        number = static_cast<std::uint32_t>(positions_m_.size());
        const glm::dvec3 exact = world.point_m(grid.offset_m(static_cast<std::size_t>(node.x)),
                                               grid.offset_m(static_cast<std::size_t>(node.y)),
                                               static_cast<double>(grid.height_m[index(node)]));
        positions_m_.push_back(glm::round(exact / kTerrainStepM) * kTerrainStepM);
      }
    }
    normals_.assign(positions_m_.size(), glm::dvec3(0.0));
    for (const Triangle& t : triangles) {
      const std::array<std::uint32_t, 3> n{number(t.a), number(t.b), number(t.c)};
      const glm::dvec3 twice_area = glm::cross(positions_m_[n[1]] - positions_m_[n[0]],
                                               positions_m_[n[2]] - positions_m_[n[0]]);
      area_m2_ += 0.5 * glm::length(twice_area);
      for (const std::uint32_t i : n) normals_[i] += twice_area;
    }
    for (glm::dvec3& normal : normals_) normal = glm::normalize(normal);
  }

  [[nodiscard]] std::uint32_t number(Node node) const { return numbers_[index(node)]; }
  [[nodiscard]] const glm::dvec3& position_m(std::uint32_t i) const { return positions_m_[i]; }
  [[nodiscard]] const glm::dvec3& normal(std::uint32_t i) const { return normals_[i]; }
  [[nodiscard]] double area_m2() const { return area_m2_; }

 private:
  static constexpr std::uint32_t kUnused = ~std::uint32_t{0};

  [[nodiscard]] std::size_t index(Node node) const {
    return grid_.index(static_cast<std::size_t>(node.x), static_cast<std::size_t>(node.y));
  }

  const HeightGrid& grid_;
  std::vector<std::uint32_t> numbers_;
  std::vector<glm::dvec3> positions_m_;
  std::vector<glm::dvec3> normals_;
  double area_m2_ = 0.0;
};

/// Cuts the triangles into tiles along the quarters of the grid.
class Tiler {
 public:
  Tiler(const HeightGrid& grid, std::span<const std::uint8_t> material,
        const TerrainOptions& options, const Vertices& vertices)
      : grid_(grid), material_(material), options_(options), vertices_(vertices) {}

  void cut(std::span<Triangle> triangles, Node corner, int edge, std::vector<TerrainTile>& out) {
    if (triangles.empty()) return;
    if (edge > 1 &&
        (triangles.size() > options_.max_tile_triangles || grid_.spacing_m * edge > kMaxTileM)) {
      // Three times the middle of a triangle is a whole number.
      const int half = edge / 2;
      const auto north = std::partition(triangles.begin(), triangles.end(), [&](const Triangle& t) {
        return t.a.y + t.b.y + t.c.y < 3 * (corner.y + half);
      });
      const auto split = [&](std::span<Triangle> row, int y) {
        const auto east = std::partition(row.begin(), row.end(), [&](const Triangle& t) {
          return t.a.x + t.b.x + t.c.x < 3 * (corner.x + half);
        });
        cut({row.begin(), east}, {corner.x, y}, half, out);
        cut({east, row.end()}, {corner.x + half, y}, half, out);
      };
      split({triangles.begin(), north}, corner.y);
      split({north, triangles.end()}, corner.y + half);
      return;
    }
    out.push_back(tile(triangles));
  }

 private:
  [[nodiscard]] std::uint8_t material_of(const Triangle& t) const {
    if (material_.empty()) return 0;
    const auto third = [](int sum) { return static_cast<std::size_t>((2 * sum + 3) / 6); };
    return material_[grid_.index(third(t.a.x + t.b.x + t.c.x), third(t.a.y + t.b.y + t.c.y))];
  }

  [[nodiscard]] TerrainTile tile(std::span<const Triangle> triangles) const {
    TerrainTile out;
    glm::dvec3 lo(std::numeric_limits<double>::infinity());
    glm::dvec3 hi = -lo;
    for (const Triangle& t : triangles) {
      for (const Node node : {t.a, t.b, t.c}) {
        lo = glm::min(lo, vertices_.position_m(vertices_.number(node)));
        hi = glm::max(hi, vertices_.position_m(vertices_.number(node)));
      }
    }
    out.origin_world_m = glm::round(0.5 * (lo + hi));
    std::unordered_map<std::uint64_t, std::uint32_t> known;  // of part and vertex
    for (const Triangle& t : triangles) {
      const std::uint8_t material = material_of(t);
      auto part = std::ranges::find(out.parts, std::uint32_t{material}, &TerrainPart::material);
      if (part == out.parts.end()) {
        out.parts.push_back(
            {.material = material, .positions_m = {}, .normals = {}, .indices = {}});
        part = out.parts.end() - 1;
      }
      for (const Node node : {t.a, t.b, t.c}) {
        const std::uint32_t vertex = vertices_.number(node);
        const auto [found, is_new] =
            known.try_emplace(std::uint64_t{material} << 32U | vertex, part->positions_m.size());
        if (is_new) {
          part->positions_m.emplace_back(vertices_.position_m(vertex) - out.origin_world_m);
          part->normals.emplace_back(vertices_.normal(vertex));
        }
        part->indices.push_back(found->second);
      }
    }
    std::ranges::sort(out.parts, {}, &TerrainPart::material);
    return out;
  }

  const HeightGrid& grid_;
  std::span<const std::uint8_t> material_;
  const TerrainOptions& options_;
  const Vertices& vertices_;
};

Result<void> check(const HeightGrid& grid, std::span<const std::uint8_t> material,
                   const TerrainOptions& options) {
  const auto require = [](bool valid, const char* name, double value,
                          const char* rule) -> Result<void> {
    if (valid) return {};
    return make_error(ErrorCode::invalid_argument, fmt::format("{} = {}: {}", name, value, rule));
  };
  const std::size_t points = grid.points() * grid.points();
  for (const Result<void>& done :
       {require(
            grid.cells >= 2 && grid.cells <= kMaxTerrainCells && std::has_single_bit(grid.cells),
            "cells", grid.cells, "must be a power of two in 2 .. 8192"),
        require(grid.spacing_m >= 0.01 && grid.spacing_m <= 1e4, "spacing_m", grid.spacing_m,
                "must be in 0.01 .. 10000"),
        require(grid.height_m.size() == points, "height_m.size()",
                static_cast<double>(grid.height_m.size()), "must be the points of the grid"),
        require(material.empty() || material.size() == points, "material.size()",
                static_cast<double>(material.size()), "must be 0, or the points of the grid"),
        require(options.radius_m > 0.0 && options.radius_m <= 1e6, "radius_m", options.radius_m,
                "must be in 0 .. 1e6"),
        require(options.error_m >= 0.01 && options.error_m <= 1000.0, "error_m", options.error_m,
                "must be in 0.01 .. 1000"),
        require(options.error_rad >= 0.0 && options.error_rad <= 0.1, "error_rad",
                options.error_rad, "must be in 0 .. 0.1"),
        require(options.cover_rad >= 0.0 && options.cover_rad <= 1.0, "cover_rad",
                options.cover_rad, "must be in 0 .. 1"),
        require(options.max_tile_triangles >= 1000, "max_tile_triangles",
                options.max_tile_triangles, "must be at least 1000")}) {
    if (!done) return done;
  }
  return {};
}

}  // namespace

glm::dvec3 terrain_point_m(const physics::GeoPlace& place, double east_m, double north_m,
                           double height_m) {
  return WorldPoints(place).point_m(east_m, north_m, height_m);
}

Result<Terrain> triangulate_terrain(const HeightGrid& grid, std::span<const std::uint8_t> material,
                                    const TerrainOptions& options) {
  if (auto valid = check(grid, material, options); !valid) {
    return tl::unexpected(std::move(valid.error()));
  }
  std::vector<Triangle> triangles = Network(grid, material, options).triangles();
  const Vertices vertices(grid, triangles);
  Terrain out;
  out.triangles = triangles.size();
  out.area_m2 = vertices.area_m2();
  Tiler(grid, material, options, vertices)
      .cut(triangles, {0, 0}, static_cast<int>(grid.cells), out.tiles);
  return out;
}

Result<GeneratedFile> write_terrain(const std::filesystem::path& file, const Terrain& terrain,
                                    std::span<const std::string> material_names) {
  Scene scene;
  for (const TerrainTile& tile : terrain.tiles) {
    SceneMesh mesh;
    mesh.name = fmt::format("tile_{}", scene.meshes.size());
    for (const TerrainPart& part : tile.parts) {
      EMIT_CHECK_OP(part.material, <, material_names.size());
      mesh.parts.push_back(
          {material_names[part.material], false, part.positions_m, part.normals, {}, part.indices});
    }
    const std::string name = mesh.name;
    scene.place(scene.add_mesh(std::move(mesh)), name, tile.origin_world_m);
  }
  return write_glb(file, scene);
}

}  // namespace emit::scenegen
