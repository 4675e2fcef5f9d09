// SPDX-License-Identifier: Apache-2.0
#include "triangulation.hpp"

#include <algorithm>
#include <deque>

#include "emit/physics/check.hpp"

namespace emit::scenegen {
namespace {

/// Holds products of four differences of coordinates.
__extension__ using Wide = __int128;

constexpr std::uint32_t next(std::uint32_t side) {
  return side == 2 ? 0 : side + 1;
}
constexpr std::uint32_t previous(std::uint32_t side) {
  return side == 0 ? 2 : side - 1;
}

}  // namespace

Triangulation::Triangulation(const Point& low, const Point& high)
    : points_{low, {high.x, low.y}, high, {low.x, high.y}},
      triangle_of_{0, 0, 0, 1},
      triangles_{{{0, 1, 2}, {kNone, 1, kNone}}, {{0, 2, 3}, {kNone, kNone, 0}}} {
  EMIT_CHECK(low.x < high.x && low.y < high.y);
  for (std::uint32_t i = 0; i < 4; ++i) index_of_[{points_[i].x, points_[i].y}] = i;
}

/// Twice the area of a triangle, positive where its corners go round counter-clockwise.
std::int64_t Triangulation::turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
  const Point ab = points_[b] - points_[a];
  const Point ac = points_[c] - points_[a];
  return ab.x * ac.y - ab.y * ac.x;
}

/// True for a point inside the circle through the corners of a triangle. The circle of a triangle
/// without area is the half-plane that its longest side faces.
bool Triangulation::circle_holds(const Triangle& triangle, std::uint32_t point) const {
  const Point a = points_[triangle.corner[0]] - points_[point];
  const Point b = points_[triangle.corner[1]] - points_[point];
  const Point c = points_[triangle.corner[2]] - points_[point];
  const auto term = [](const Point& p, const Point& q, const Point& r) {
    return Wide{p.x * p.x + p.y * p.y} * Wide{q.x * r.y - q.y * r.x};
  };
  return term(a, b, c) + term(b, c, a) + term(c, a, b) > 0;
}

/// Walks towards a point. The walk ends because no segment is there yet (Delaunay).
std::uint32_t Triangulation::triangle_at(const Point& point) const {
  std::uint32_t at = last_;
  for (std::uint32_t side = 0; side < 3;) {
    const Point& a = points_[triangles_[at].corner[next(side)]];
    const Point& b = points_[triangles_[at].corner[previous(side)]];
    const Point ab = b - a;
    const Point ap = point - a;
    if (ab.x * ap.y - ab.y * ap.x < 0) {
      at = triangles_[at].across[side];
      EMIT_CHECK_OP(at, !=, kNone);
      side = 0;
    } else {
      ++side;
    }
  }
  return at;
}

std::uint32_t Triangulation::place_of(std::uint32_t triangle, std::uint32_t neighbour) const {
  const auto& across = triangles_[triangle].across;
  const auto found = std::ranges::find(across, neighbour);
  EMIT_CHECK(found != across.end());
  return static_cast<std::uint32_t>(found - across.begin());
}

bool Triangulation::is_segment(std::uint32_t a, std::uint32_t b) const {
  return segments_.contains(std::minmax(a, b));
}

void Triangulation::replace_neighbour(std::uint32_t triangle, std::uint32_t from,
                                      std::uint32_t to) {
  if (triangle != kNone) triangles_[triangle].across[place_of(triangle, from)] = to;
}

/// True where the two triangles at a side are a quadrangle that both diagonals cut in two.
bool Triangulation::can_flip(std::uint32_t triangle, std::uint32_t side) const {
  const Triangle& t = triangles_[triangle];
  const Triangle& u = triangles_[t.across[side]];
  const std::uint32_t far = u.corner[place_of(t.across[side], triangle)];
  return turn(t.corner[side], t.corner[next(side)], far) > 0 &&
         turn(t.corner[side], far, t.corner[previous(side)]) > 0;
}

/// Replaces the side of a triangle by the other diagonal of the quadrangle.
void Triangulation::flip(std::uint32_t triangle, std::uint32_t side) {
  const std::uint32_t other = triangles_[triangle].across[side];
  const std::uint32_t other_side = place_of(other, triangle);
  const Triangle t = triangles_[triangle];
  const Triangle u = triangles_[other];
  const std::uint32_t near = t.corner[side];
  const std::uint32_t a = t.corner[next(side)];
  const std::uint32_t b = t.corner[previous(side)];
  const std::uint32_t far = u.corner[other_side];
  const std::uint32_t beside_near_b = t.across[next(side)];
  const std::uint32_t beside_near_a = t.across[previous(side)];
  const std::uint32_t beside_far_a = u.across[next(other_side)];
  const std::uint32_t beside_far_b = u.across[previous(other_side)];
  triangles_[triangle] = {{near, a, far}, {beside_far_a, other, beside_near_a}};
  triangles_[other] = {{near, far, b}, {beside_far_b, beside_near_b, triangle}};
  replace_neighbour(beside_far_a, other, triangle);
  replace_neighbour(beside_near_b, triangle, other);
  triangle_of_[near] = triangle_of_[a] = triangle_of_[far] = triangle;
  triangle_of_[b] = other;
}

/// Flips sides until no circle around a triangle holds the far corner of a neighbour.
void Triangulation::flip_while_round(std::vector<std::uint32_t>& waiting) {
  while (!waiting.empty()) {
    const std::uint32_t triangle = waiting.back();
    waiting.pop_back();
    for (std::uint32_t side = 0; side < 3; ++side) {
      const Triangle& t = triangles_[triangle];
      const std::uint32_t other = t.across[side];
      if (other == kNone || is_segment(t.corner[next(side)], t.corner[previous(side)])) continue;
      if (!circle_holds(t, triangles_[other].corner[place_of(other, triangle)])) continue;
      flip(triangle, side);
      waiting.push_back(triangle);
      waiting.push_back(other);
      break;
    }
  }
}

std::uint32_t Triangulation::add_point(const Point& point) {
  const auto index = static_cast<std::uint32_t>(points_.size());
  const auto [found, is_new] = index_of_.try_emplace({point.x, point.y}, index);
  if (!is_new) return found->second;
  EMIT_CHECK(segments_.empty());
  points_.push_back(point);
  // Split a triangle into three. Where the point lies on a side, one of them has no area; the flips
  // below take it away.
  const std::uint32_t first = triangle_at(point);
  const auto second = static_cast<std::uint32_t>(triangles_.size());
  const std::uint32_t third = second + 1;
  const Triangle whole = triangles_[first];
  const auto& [a, b, c] = whole.corner;
  const auto& [beside_bc, beside_ca, beside_ab] = whole.across;
  triangles_[first] = {{a, b, index}, {second, third, beside_ab}};
  triangles_.push_back({{b, c, index}, {third, first, beside_bc}});
  triangles_.push_back({{c, a, index}, {first, second, beside_ca}});
  replace_neighbour(beside_bc, first, second);
  replace_neighbour(beside_ca, first, third);
  triangle_of_.push_back(first);
  triangle_of_[a] = triangle_of_[b] = first;
  triangle_of_[c] = second;
  std::vector<std::uint32_t> waiting = {first, second, third};
  flip_while_round(waiting);
  last_ = triangle_of_[index];
  return index;
}

/// Returns the triangle that has the edge from a to b in its own direction, and the side that is
/// this edge.
std::pair<std::uint32_t, std::uint32_t> Triangulation::find_edge(std::uint32_t a,
                                                                 std::uint32_t b) const {
  // Turn around the first point in both directions: at a corner of the rectangle the turn ends.
  for (const bool leftwards : {true, false}) {
    std::uint32_t at = triangle_of_[a];
    do {
      const Triangle& t = triangles_[at];
      const auto corner =
          static_cast<std::uint32_t>(std::ranges::find(t.corner, a) - t.corner.begin());
      if (t.corner[next(corner)] == b) return {at, previous(corner)};
      at = t.across[leftwards ? next(corner) : previous(corner)];
    } while (at != kNone && at != triangle_of_[a]);
  }
  EMIT_CHECK(false);
  return {};
}

/// Collects the edges that a straight line crosses. Returns where it ends: at `to` or at the first
/// point on the way.
std::uint32_t Triangulation::crossed_edges(std::uint32_t from, std::uint32_t to,
                                           std::deque<Edge>& edges) const {
  // Turn around the first point until the line leaves through the facing side of a triangle.
  std::uint32_t at = triangle_of_[from];
  std::uint32_t right = 0;
  std::uint32_t left = 0;
  const Point along = points_[to] - points_[from];
  for (;;) {
    const Triangle& t = triangles_[at];
    const auto corner =
        static_cast<std::uint32_t>(std::ranges::find(t.corner, from) - t.corner.begin());
    right = t.corner[next(corner)];
    left = t.corner[previous(corner)];
    const std::int64_t side = turn(from, to, right);
    const Point there = points_[right] - points_[from];
    if (side == 0 && there.x * along.x + there.y * along.y > 0) return right;
    if (side < 0 && turn(from, to, left) > 0) break;
    at = t.across[next(corner)];
    EMIT_CHECK_OP(at, !=, kNone);
  }
  // Go on from triangle to triangle.
  for (;;) {
    edges.emplace_back(right, left);
    const auto [inner, side] = find_edge(left, right);
    const std::uint32_t far = triangles_[inner].corner[side];
    if (far == to) return to;
    const std::int64_t way = turn(from, to, far);
    if (way == 0) return far;
    (way > 0 ? left : right) = far;
  }
}

void Triangulation::add_segment(std::uint32_t from, std::uint32_t to) {
  while (from != to) {
    std::deque<Edge> edges;
    const std::uint32_t end = crossed_edges(from, to, edges);
    while (!edges.empty()) {
      const Edge edge = edges.front();
      edges.pop_front();
      EMIT_CHECK(!is_segment(edge.first, edge.second));
      const auto [triangle, side] = find_edge(edge.first, edge.second);
      if (!can_flip(triangle, side)) {
        edges.push_back(edge);
        continue;
      }
      flip(triangle, side);
      // The new edge runs from the triangle's first corner to its last one.
      const std::uint32_t near = triangles_[triangle].corner[0];
      const std::uint32_t far = triangles_[triangle].corner[2];
      if (near == from || near == end || far == from || far == end) continue;
      if ((turn(from, end, near) > 0) != (turn(from, end, far) > 0)) edges.emplace_back(near, far);
    }
    segments_.insert(std::minmax(from, end));
    from = end;
  }
}

void Triangulation::improve() {
  std::vector<std::uint32_t> waiting(triangles_.size());
  for (std::uint32_t i = 0; i < waiting.size(); ++i) waiting[i] = i;
  flip_while_round(waiting);
}

}  // namespace emit::scenegen
