// SPDX-License-Identifier: Apache-2.0
#include "alpha_rings.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>

namespace emit::scene {
namespace {

/// Texels for which a clamped image goes on.
constexpr double kClampedPx = 1e4;
/// Crossings keep this share of a cell's side from its corners, so that lines never touch.
constexpr double kMinShare = 1e-3;

/// Columns or rows of the grid: the edge of the kept area, the edge of the image, the middles of
/// the texels, and both edges again.
std::vector<double> places(int size, Wrap wrap) {
  const double beyond = wrap == Wrap::clamp ? kClampedPx : 0.0;
  std::vector<double> out{-beyond, -beyond};
  for (int i = 0; i < size; ++i) out.push_back(i + 0.5);
  out.push_back(size + beyond);
  out.push_back(size + beyond);
  return out;
}

/// Opacity less the cutoff over the grid. Outside the image nothing is kept.
class Field {
 public:
  explicit Field(const AlphaMask& mask) : mask_(mask) {}

  [[nodiscard]] int columns() const { return mask_.frame.width_px + 4; }
  [[nodiscard]] int rows() const { return mask_.frame.height_px + 4; }

  [[nodiscard]] double at(int column, int row) const {
    if (column == 0 || row == 0 || column == columns() - 1 || row == rows() - 1) return -1.0;
    const double x = column - 1.5;
    const double y = row - 1.5;
    // A column at the edge lies between the texels of both sides.
    return alpha_at(mask_, clamped(x, mask_.frame.width_px), clamped(y, mask_.frame.height_px)) -
           mask_.cutoff;
  }

 private:
  static double clamped(double middle, int size) {
    return std::clamp(middle, 0.0, static_cast<double>(size));
  }

  const AlphaMask& mask_;
};

}  // namespace

std::vector<std::vector<glm::dvec2>> alpha_rings(const AlphaMask& mask) {
  const Field field(mask);
  const std::vector<double> xs = places(mask.frame.width_px, mask.frame.wrap_u);
  const std::vector<double> ys = places(mask.frame.height_px, mask.frame.wrap_v);
  // Side s of a cell: 0 below row (its first row), 1 last column, 2 last row, 3 first column.
  const auto side_id = [&](int column, int row, int side) {
    const int c = column + (side == 1 ? 1 : 0);
    const int r = row + (side == 2 ? 1 : 0);
    const auto node = static_cast<std::uint64_t>(r) * static_cast<std::uint64_t>(field.columns()) +
                      static_cast<std::uint64_t>(c);
    return 2 * node + (side == 1 || side == 3 ? 1U : 0U);
  };
  std::unordered_map<std::uint64_t, std::uint64_t> next;
  std::vector<std::uint64_t> begins;
  std::vector<double> upper(static_cast<std::size_t>(field.columns()));
  std::vector<double> lower(static_cast<std::size_t>(field.columns()));
  for (int c = 0; c < field.columns(); ++c) lower[static_cast<std::size_t>(c)] = field.at(c, 0);
  for (int row = 0; row + 1 < field.rows(); ++row) {
    std::swap(upper, lower);
    for (int c = 0; c < field.columns(); ++c) {
      lower[static_cast<std::size_t>(c)] = field.at(c, row + 1);
    }
    for (int column = 0; column + 1 < field.columns(); ++column) {
      const auto c = static_cast<std::size_t>(column);
      // Corners in the order of the sides: side s runs from corner s to corner s + 1.
      const double corners[4] = {upper[c], upper[c + 1], lower[c + 1], lower[c]};
      int kept = 0;
      for (const double value : corners) kept += value >= 0.0 ? 1 : 0;
      if (kept == 0 || kept == 4) continue;
      // A line enters where the kept side ends and leaves where the next one begins.
      int leaving[2];
      int entering[2];
      int leaves = 0;
      int enters = 0;
      for (int side = 0; side < 4; ++side) {
        const bool from = corners[side] >= 0.0;
        const bool to = corners[(side + 1) % 4] >= 0.0;
        if (from && !to) leaving[leaves++] = side;
        if (!from && to) entering[enters++] = side;
      }
      if (leaves == 1) {
        next[side_id(column, row, leaving[0])] = side_id(column, row, entering[0]);
        begins.push_back(side_id(column, row, leaving[0]));
        continue;
      }
      const bool joined = corners[0] + corners[1] + corners[2] + corners[3] >= 0.0;
      for (int k = 0; k < 2; ++k) {
        // Joined corners: each line goes around the clear corner that follows its begin.
        const int end = joined ? (leaving[k] + 1) % 4 : (leaving[k] + 3) % 4;
        next[side_id(column, row, leaving[k])] = side_id(column, row, end);
        begins.push_back(side_id(column, row, leaving[k]));
      }
    }
  }

  const auto point_of = [&](std::uint64_t id) {
    const auto node = id / 2;
    const auto c = static_cast<int>(node % static_cast<std::uint64_t>(field.columns()));
    const auto r = static_cast<int>(node / static_cast<std::uint64_t>(field.columns()));
    const bool down = id % 2 == 1;
    const double a = field.at(c, r);
    const double b = field.at(c + (down ? 0 : 1), r + (down ? 1 : 0));
    const double share = std::clamp(a / (a - b), kMinShare, 1.0 - kMinShare);
    const auto column = static_cast<std::size_t>(c);
    const auto line = static_cast<std::size_t>(r);
    glm::dvec2 point(xs[column], ys[line]);
    if (down) {
      point.y += share * (ys[line + 1] - ys[line]);
    } else {
      point.x += share * (xs[column + 1] - xs[column]);
    }
    return point;
  };
  std::vector<std::vector<glm::dvec2>> rings;
  for (const std::uint64_t begin : begins) {
    auto link = next.find(begin);
    if (link == next.end()) continue;  // part of a line that is already there
    std::vector<glm::dvec2> ring;
    while (link != next.end()) {
      ring.push_back(point_of(link->first));
      const std::uint64_t following = link->second;
      next.erase(link);
      link = next.find(following);
    }
    ring.push_back(ring.front());
    if (ring.size() >= 4) rings.push_back(std::move(ring));
  }
  return rings;
}

}  // namespace emit::scene
