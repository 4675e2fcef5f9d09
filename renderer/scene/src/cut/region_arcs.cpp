// SPDX-License-Identifier: Apache-2.0
#include "region_arcs.hpp"

#include <algorithm>
#include <cstddef>
#include <tuple>
#include <utility>

namespace emit::scene {
namespace {

/// Texels for which a clamped image goes on.
constexpr double kClampedPx = 1e4;
/// A block with more sides between regions than this is closed along its own sides.
constexpr int kBusySides = 512;

/// Directions from a corner of texels, counted so that opposite ones differ by two.
constexpr int kStep[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

/// The sides of texels that part regions. A corner (x, y) is the first corner of texel (x, y).
class Sides {
 public:
  explicit Sides(const RegionImage& image)
      : image_(image),
        width_(image.frame.width_px),
        height_(image.frame.height_px),
        block_columns_((width_ + kArcBlockPx - 1) / kArcBlockPx),
        busy_(static_cast<std::size_t>(block_columns_) *
              static_cast<std::size_t>((height_ + kArcBlockPx - 1) / kArcBlockPx)) {
    std::vector<int> count(busy_.size(), 0);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        int& sides = count[block(x, y)];
        sides += x > 0 && image_.at(x - 1, y) != image_.at(x, y) ? 1 : 0;
        sides += y > 0 && image_.at(x, y - 1) != image_.at(x, y) ? 1 : 0;
      }
    }
    std::ranges::transform(count, busy_.begin(),
                           [](int sides) { return sides > kBusySides ? 1 : 0; });
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

  /// Region of a texel; kNoRegion outside the image.
  [[nodiscard]] std::uint8_t region(int x, int y) const {
    return x < 0 || y < 0 || x >= width_ || y >= height_ ? kNoRegion : image_.at(x, y);
  }
  /// Regions on the left and on the right of the side that leaves a corner in a direction.
  [[nodiscard]] std::pair<std::uint8_t, std::uint8_t> beside(int x, int y, int direction) const {
    switch (direction) {
      case 0:
        return {region(x, y), region(x, y - 1)};
      case 1:
        return {region(x - 1, y), region(x, y)};
      case 2:
        return {region(x - 1, y - 1), region(x - 1, y)};
      default:
        return {region(x, y - 1), region(x - 1, y - 1)};
    }
  }
  /// True where the side that leaves a corner in a direction parts anything.
  [[nodiscard]] bool parts(int x, int y, int direction) const {
    const int to_x = x + kStep[direction][0];
    const int to_y = y + kStep[direction][1];
    if (to_x < 0 || to_y < 0 || to_x > width_ || to_y > height_) return false;
    const auto [left, right] = beside(x, y, direction);
    if (left != right) return true;
    if (left == kNoRegion) return false;
    const int low_x = std::min(x, to_x);
    const int low_y = std::min(y, to_y);
    if (direction % 2 == 0) {
      return y % kArcBlockPx == 0 &&
             (busy_[block(low_x, y)] != 0 || busy_[block(low_x, y - 1)] != 0);
    }
    return x % kArcBlockPx == 0 && (busy_[block(x, low_y)] != 0 || busy_[block(x - 1, low_y)] != 0);
  }

 private:
  [[nodiscard]] std::size_t block(int x, int y) const {
    return static_cast<std::size_t>(y / kArcBlockPx) * static_cast<std::size_t>(block_columns_) +
           static_cast<std::size_t>(x / kArcBlockPx);
  }

  const RegionImage& image_;
  int width_;
  int height_;
  int block_columns_;
  std::vector<std::uint8_t> busy_;
};

/// Follows the sides of texels from corner to corner.
class Walk {
 public:
  explicit Walk(const RegionImage& image) : sides_(image), frame_(image.frame) {
    const auto corners = static_cast<std::size_t>(sides_.width() + 1) *
                         static_cast<std::size_t>(sides_.height() + 1);
    done_.assign(2 * corners, false);
  }

  std::vector<RegionArc> arcs() {
    // Lines between corners where three or more meet come first. What is left are rings.
    for (const bool rings : {false, true}) {
      for (int y = 0; y <= sides_.height(); ++y) {
        for (int x = 0; x <= sides_.width(); ++x) {
          const int count = degree(x, y);
          if (count == 0 || (count == 2) != rings) continue;
          for (int direction = 0; direction < 4; ++direction) {
            if (sides_.parts(x, y, direction) && !done_[side(x, y, direction)]) {
              follow(x, y, direction);
            }
          }
        }
      }
    }
    return std::move(arcs_);
  }

 private:
  /// Number of lines that meet at a corner. Two more places count as ends of lines: the corners of
  /// the image, which lines that are made straight would cut off, and those where a line ends at
  /// the opposite edge, which lies here where the image repeats.
  [[nodiscard]] int degree(int x, int y) const {
    const bool at_edge_u = x == 0 || x == sides_.width();
    const bool at_edge_v = y == 0 || y == sides_.height();
    int count = at_edge_u && at_edge_v ? 1 : 0;
    if (at_edge_u && !at_edge_v && frame_.wrap_u == Wrap::repeat) {
      count += sides_.parts(sides_.width() - x, y, x == 0 ? 2 : 0) ? 1 : 0;
    }
    if (at_edge_v && !at_edge_u && frame_.wrap_v == Wrap::repeat) {
      count += sides_.parts(x, sides_.height() - y, y == 0 ? 3 : 1) ? 1 : 0;
    }
    for (int direction = 0; direction < 4; ++direction) {
      count += sides_.parts(x, y, direction) ? 1 : 0;
    }
    return count;
  }
  /// Number of the side that leaves a corner in a direction, the same from both of its ends.
  [[nodiscard]] std::size_t side(int x, int y, int direction) const {
    if (direction == 2) --x;
    if (direction == 3) --y;
    return 2 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(sides_.width() + 1) +
                static_cast<std::size_t>(x)) +
           static_cast<std::size_t>(direction % 2);
  }
  [[nodiscard]] glm::dvec2 point(int x, int y) const {
    const auto place = [](int i, int size, Wrap wrap) {
      if (wrap != Wrap::clamp) return static_cast<double>(i);
      if (i == 0) return -kClampedPx;
      return i == size ? size + kClampedPx : static_cast<double>(i);
    };
    return {place(x, sides_.width(), frame_.wrap_u), place(y, sides_.height(), frame_.wrap_v)};
  }

  void follow(int x, int y, int direction) {
    RegionArc arc;
    std::tie(arc.left, arc.right) = sides_.beside(x, y, direction);
    const int first_x = x;
    const int first_y = y;
    arc.points.push_back(point(x, y));
    while (true) {
      done_[side(x, y, direction)] = true;
      x += kStep[direction][0];
      y += kStep[direction][1];
      const bool at_end = degree(x, y) != 2 || (x == first_x && y == first_y);
      int next = direction;
      if (!at_end) {
        // Two sides meet here: the line came along one and leaves along the other.
        for (const int turn : {direction, (direction + 1) % 4, (direction + 3) % 4}) {
          if (sides_.parts(x, y, turn)) {
            next = turn;
            break;
          }
        }
      }
      if (at_end || next != direction) arc.points.push_back(point(x, y));
      if (at_end) break;
      direction = next;
    }
    arcs_.push_back(std::move(arc));
  }

  Sides sides_;
  const ImageFrame& frame_;
  std::vector<bool> done_;  ///< by side()
  std::vector<RegionArc> arcs_;
};

}  // namespace

std::vector<RegionArc> region_arcs(const RegionImage& image) {
  return Walk(image).arcs();
}

}  // namespace emit::scene
