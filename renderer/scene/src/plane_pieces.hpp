// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <utility>
#include <vector>

/// Convex pieces of a triangle in the coordinates of its plane, and how lines cut them.
/// Any thread: pure functions.
namespace emit::scene {

/// Point in the coordinates of a plane.
using Point2 = glm::dvec2;

/// Corner of a piece: weights of the cut triangle's corners, and where that is in the plane.
struct PieceCorner {
  glm::dvec3 weight{0.0};
  Point2 at{0.0};
};
/// Convex polygon, counter-clockwise.
using Piece = std::vector<PieceCorner>;

/// Returns the third component of the cross product.
[[nodiscard]] inline double cross2(const Point2& a, const Point2& b) {
  return a.x * b.y - a.y * b.x;
}

/// A line; the inside is on its left.
struct Line {
  Point2 from{0.0};
  Point2 direction{1.0, 0.0};
  [[nodiscard]] double side(const Point2& p) const { return cross2(direction, p - from); }
};

/// Coordinates of a plane: the two axes along which its normal is smallest. Parallel projection
/// keeps lines, and what lies inside what.
struct Projection {
  int u = 0;
  int v = 1;
  explicit Projection(const glm::dvec3& normal) {
    const glm::dvec3 n = glm::abs(normal);
    const int dropped = n.x >= n.y && n.x >= n.z ? 0 : n.y >= n.z ? 1 : 2;
    u = (dropped + 1) % 3;
    v = (dropped + 2) % 3;
    if (normal[dropped] < 0.0) std::swap(u, v);
  }
  [[nodiscard]] Point2 operator()(const glm::dvec3& p) const { return {p[u], p[v]}; }
};

/// Returns the area; it is negative for a clockwise piece.
[[nodiscard]] double area2(const Piece& piece);
[[nodiscard]] double perimeter(const Piece& piece);
/// Splits a convex piece into the part on the left of a line and that on its right. Corners within
/// `tolerance` of the line belong to both parts. A part with fewer than three corners is nothing.
[[nodiscard]] std::pair<Piece, Piece> split(const Piece& piece, const Line& line, double tolerance);
/// Splits a piece along the sides `lines` of a triangle and appends what lies outside of them to
/// `out`. It leaves out what does not reach out from under the triangle with these `edges`.
void subtract(Piece piece, const std::array<Line, 3>& lines, const std::array<Line, 3>& edges,
              double tolerance, std::vector<Piece>& out);
/// Returns the piece with those of `corners` set into its edges that lie on them.
[[nodiscard]] Piece with_corners_on_edges(const Piece& piece,
                                          const std::vector<PieceCorner>& corners,
                                          double tolerance);
/// Cuts a convex polygon into triangles and returns the numbers of their corners. Some corners may
/// lie on straight edges. The smallest corner triangle is cut off first, so that no corner on an
/// edge is left without a triangle.
[[nodiscard]] std::vector<std::array<std::size_t, 3>> triangulate(const Piece& piece);

}  // namespace emit::scene
