// SPDX-License-Identifier: Apache-2.0
#include "plane_pieces.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace emit::scene {
namespace {

/// Returns weights rounded to 2^-36, far finer than float32. Two pieces may reach the same corner
/// over different edges; rounding gives it the same position to the last bit.
glm::dvec3 rounded(const glm::dvec3& weight) {
  constexpr double kSteps = 68719476736.0;  // 2^36
  return glm::round(weight * kSteps) / kSteps;
}

}  // namespace

double area2(const Piece& piece) {
  double sum = 0.0;
  for (std::size_t i = 0; i < piece.size(); ++i) {
    sum += cross2(piece[i].at, piece[(i + 1) % piece.size()].at);
  }
  return 0.5 * sum;
}

double perimeter(const Piece& piece) {
  double sum = 0.0;
  for (std::size_t i = 0; i < piece.size(); ++i) {
    sum += glm::distance(piece[i].at, piece[(i + 1) % piece.size()].at);
  }
  return sum;
}

std::pair<Piece, Piece> split(const Piece& piece, const Line& line, double tolerance) {
  Piece left;
  Piece right;
  for (std::size_t i = 0; i < piece.size(); ++i) {
    const PieceCorner& a = piece[i];
    const PieceCorner& b = piece[(i + 1) % piece.size()];
    const double side_a = line.side(a.at);
    const double side_b = line.side(b.at);
    if (side_a >= -tolerance) left.push_back(a);
    if (side_a <= tolerance) right.push_back(a);
    if ((side_a > tolerance && side_b < -tolerance) ||
        (side_a < -tolerance && side_b > tolerance)) {
      const double t = side_a / (side_a - side_b);
      const PieceCorner cut{rounded(glm::mix(a.weight, b.weight, t)), glm::mix(a.at, b.at, t)};
      left.push_back(cut);
      right.push_back(cut);
    }
  }
  return {std::move(left), std::move(right)};
}

void subtract(Piece piece, const std::array<Line, 3>& lines, const std::array<Line, 3>& edges,
              double tolerance, std::vector<Piece>& out) {
  Piece inside = piece;
  for (const Line& line : lines) {
    inside = split(inside, line, tolerance).first;
    if (inside.size() < 3) break;
  }
  if (inside.size() < 3 || !(std::abs(area2(inside)) > 0.0)) {
    out.push_back(std::move(piece));
    return;
  }
  for (const Line& line : lines) {
    auto [left, right] = split(piece, line, tolerance);
    const bool hidden = std::ranges::all_of(right, [&](const PieceCorner& corner) {
      return std::ranges::all_of(
          edges, [&](const Line& edge) { return edge.side(corner.at) >= -10.0 * tolerance; });
    });
    if (right.size() >= 3 && !hidden) out.push_back(std::move(right));
    piece = std::move(left);
  }
}

Piece with_corners_on_edges(const Piece& piece, const std::vector<PieceCorner>& corners,
                            double tolerance) {
  Piece out;
  for (std::size_t i = 0; i < piece.size(); ++i) {
    const PieceCorner& a = piece[i];
    const PieceCorner& b = piece[(i + 1) % piece.size()];
    out.push_back(a);
    const Point2 along = b.at - a.at;
    const double length = glm::length(along);
    std::vector<std::pair<double, const PieceCorner*>> on_edge;
    for (const PieceCorner& corner : corners) {
      const Point2 to = corner.at - a.at;
      if (std::abs(cross2(along, to)) > tolerance * length) continue;
      const double t = glm::dot(along, to) / length;
      if (t > tolerance && t < length - tolerance) on_edge.emplace_back(t, &corner);
    }
    std::ranges::sort(on_edge, {}, [](const auto& entry) { return entry.first; });
    double last = 0.0;
    for (const auto& [t, corner] : on_edge) {
      if (t - last > tolerance) out.push_back(*corner);
      last = t;
    }
  }
  return out;
}

std::vector<std::array<std::size_t, 3>> triangulate(const Piece& piece) {
  std::vector<std::size_t> left(piece.size());
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = i;
  std::vector<std::array<std::size_t, 3>> out;
  const double least = 1e-12 * std::abs(area2(piece));
  while (left.size() >= 3) {
    double best = std::numeric_limits<double>::infinity();
    std::size_t best_at = left.size();
    for (std::size_t i = 0; i < left.size(); ++i) {
      const Point2& a = piece[left[i]].at;
      const Point2& b = piece[left[(i + 1) % left.size()]].at;
      const Point2& c = piece[left[(i + 2) % left.size()]].at;
      const double area = 0.5 * cross2(b - a, c - a);
      if (area > least && area < best) {
        best = area;
        best_at = i;
      }
    }
    if (best_at == left.size()) break;
    const std::size_t middle = (best_at + 1) % left.size();
    out.push_back({left[best_at], left[middle], left[(best_at + 2) % left.size()]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(middle));
  }
  return out;
}

}  // namespace emit::scene
