// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint4.hpp>
#include <span>
#include <vector>

#include "shared/shade_params.glsl.h"

namespace emit::renderer {

/// Sorts rectangles of a picture, those of pages and of silhouettes, by squares of it: a pixel
/// looks at what may shade its square alone, and squares without any are left out. Real time:
/// everything but the constructor is RT-safe.
class ShadeTiles {
 public:
  /// Rows and columns of groups of 8 x 8 pixels in the smallest squares.
  static constexpr std::uint32_t kLeastPx = 16;
  /// Where there would be more squares or entries, squares are twice as wide.
  static constexpr std::size_t kMostTiles = 4096;
  static constexpr std::size_t kMostEntries = 1U << 16U;

  /// Of so many pages and silhouettes in all, at most 65536 of each.
  explicit ShadeTiles(std::size_t records);

  /// A picture of which `window_px` is drawn: first column, first row, behind the last ones.
  /// Nothing is in it.
  void begin(const glm::uvec4& window_px) noexcept;
  /// Rectangles within the window, likewise; numbered as they come, each kind by itself.
  void add_page(const glm::uvec4& px) noexcept { add(px, pages_++); }
  /// After all pages.
  void add_silhouette(const glm::uvec4& px) noexcept { add(px, silhouettes_++); }
  void sort() noexcept;

  /// Those that something reaches. Of sort().
  [[nodiscard]] std::span<const gpu::ShadeTile> tiles() const noexcept { return tiles_; }
  /// Of tile t: numbers of pages, then of silhouettes, from tiles()[t].first on, in order.
  [[nodiscard]] std::span<const std::uint16_t> entries() const noexcept {
    return std::span(entries_).first(used_entries_);
  }
  [[nodiscard]] std::uint32_t tile_px() const noexcept { return tile_px_; }
  [[nodiscard]] static std::size_t most_entries(std::size_t records) noexcept {
    return kMostEntries > records ? kMostEntries : records;
  }

 private:
  struct Rectangle {
    glm::uvec4 px;
    std::uint32_t number = 0;
  };
  void add(const glm::uvec4& px, std::uint32_t number) noexcept;
  /// First and last tile of a rectangle, columns and rows.
  [[nodiscard]] glm::uvec4 tiles_of(const glm::uvec4& px) const noexcept;
  [[nodiscard]] std::size_t count_entries() const noexcept;

  glm::uvec4 window_px_{0U};
  std::uint32_t tile_px_ = kLeastPx;
  std::uint32_t columns_ = 0;
  std::uint32_t pages_ = 0;
  std::uint32_t silhouettes_ = 0;
  std::vector<Rectangle> rectangles_;
  std::vector<gpu::ShadeTile> all_;  ///< with those that nothing reaches
  std::vector<gpu::ShadeTile> tiles_;
  std::vector<std::uint16_t> entries_;
  std::size_t used_entries_ = 0;
};

}  // namespace emit::renderer
