// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <glm/ext/vector_int2_sized.hpp>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace emit::scenegen {

/// Constrained Delaunay triangulation of a rectangle. Points lie on a grid, and all decisions are
/// exact in whole numbers, so that no input can make it fail or leave a gap. Segments are forced by
/// flips (S. W. Sloan, A fast algorithm for generating constrained Delaunay triangulations,
/// Computers & Structures 47, 1993).
class Triangulation {
 public:
  using Point = glm::i64vec2;
  /// Starts with two triangles that fill a rectangle. @pre low < high; coordinates in +-1e8
  Triangulation(const Point& low, const Point& high);

  /// Adds a point and returns its index; a point that is there already keeps its index. All points
  /// come before all segments. @pre the point lies inside the rectangle, not on its rim
  std::uint32_t add_point(const Point& point);
  /// Makes a straight line between two points an edge of triangles. Lines may meet at points only.
  void add_segment(std::uint32_t from, std::uint32_t to);
  /// Makes triangles as blunt as the segments allow.
  void improve();

  /// Calls `call(a, b, c)` with the corners of each triangle, counter-clockwise.
  template <class F>
  void each_triangle(const F& call) const {
    for (const Triangle& triangle : triangles_) {
      call(points_[triangle.corner[0]], points_[triangle.corner[1]], points_[triangle.corner[2]]);
    }
  }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  struct Triangle {
    std::array<std::uint32_t, 3> corner;  ///< counter-clockwise
    std::array<std::uint32_t, 3> across;  ///< neighbour on the side that faces each corner
  };
  using Edge = std::pair<std::uint32_t, std::uint32_t>;

  [[nodiscard]] std::int64_t turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const;
  [[nodiscard]] bool circle_holds(const Triangle& triangle, std::uint32_t point) const;
  [[nodiscard]] std::uint32_t triangle_at(const Point& point) const;
  [[nodiscard]] std::uint32_t place_of(std::uint32_t triangle, std::uint32_t neighbour) const;
  [[nodiscard]] bool can_flip(std::uint32_t triangle, std::uint32_t side) const;
  [[nodiscard]] bool is_segment(std::uint32_t a, std::uint32_t b) const;
  void replace_neighbour(std::uint32_t triangle, std::uint32_t from, std::uint32_t to);
  void flip(std::uint32_t triangle, std::uint32_t side);
  void flip_while_round(std::vector<std::uint32_t>& waiting);
  [[nodiscard]] std::pair<std::uint32_t, std::uint32_t> find_edge(std::uint32_t a,
                                                                  std::uint32_t b) const;
  std::uint32_t crossed_edges(std::uint32_t from, std::uint32_t to, std::deque<Edge>& edges) const;

  std::vector<Point> points_;
  std::vector<std::uint32_t> triangle_of_;  ///< a triangle at each point
  std::vector<Triangle> triangles_;
  std::set<Edge> segments_;                                                  ///< lower index first
  std::map<std::pair<std::int64_t, std::int64_t>, std::uint32_t> index_of_;  ///< by x and y
  std::uint32_t last_ = 0;  ///< the triangle where the last point lay
};

}  // namespace emit::scenegen
