// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint4.hpp>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "shared/shade_params.glsl.h"

namespace emit::renderer {

/// Sorts rectangles of an image into its screen tiles. The rectangles are the bounds of exposure
/// tiles and of entity shadow depth maps. A pixel then reads only the rectangles that may reach its
/// screen tile, and screen tiles that nothing reaches are left out.
/// Real time: the constructor is setup only; all other functions are RT-safe.
class ShadeTiles {
 public:
  /// Columns and rows of pixels in the smallest screen tile: work groups of 8 x 8 pixels fit into
  /// it.
  static constexpr std::uint32_t kMinPx = 16;
  /// Largest numbers of screen tiles and of entries. Screen tiles become twice as wide, as often as
  /// needed, when there would be more.
  static constexpr std::size_t kMaxTiles = 4096;
  static constexpr std::size_t kMaxEntries = 1U << 16U;

  /// Reserves memory for `records` rectangles in all.
  explicit ShadeTiles(std::size_t records);

  /// Starts an image without rectangles. `window_px` is the drawn part: first column, first row,
  /// end column, end row.
  /// @pre The window lies within 65536 x 65536 pixels.
  void begin(const glm::uvec4& window_px) noexcept;
  /// Adds the rectangle of an exposure tile, given like the window. Exposure tiles are numbered in
  /// the order of the calls, from 0.
  /// @pre The rectangle is not empty and lies within the window; no shadow depth map was added yet;
  /// there is memory for it; fewer than 65536 were added, because entries have 16 bits.
  void add_exposure_tile(const glm::uvec4& px) noexcept;
  /// Adds the rectangle of an entity shadow depth map. They have numbers of their own, from 0.
  /// @pre The rectangle is not empty and lies within the window; there is memory for it; fewer than
  /// 65536 were added.
  void add_entity_shadow(const glm::uvec4& px) noexcept { add(px, shadow_maps_++); }
  /// Sorts the rectangles. tiles(), entries() and tile_px() are valid from then on.
  void sort() noexcept;

  /// Screen tiles that some rectangle reaches, row by row.
  [[nodiscard]] std::span<const gpu::ShadeTile> tiles() const noexcept { return tiles_; }
  /// Entries of all screen tiles. Those of tile t begin at tiles()[t].first: the numbers of its
  /// exposure tiles, then those of its shadow depth maps, both ascending.
  [[nodiscard]] std::span<const std::uint16_t> entries() const noexcept {
    return std::span(entries_).first(used_entries_);
  }
  /// Columns and rows of pixels in a screen tile: kMinPx times a power of two.
  [[nodiscard]] std::uint32_t tile_px() const noexcept { return tile_px_; }
  /// Largest number of entries for `records` rectangles.
  [[nodiscard]] static std::size_t max_entries(std::size_t records) noexcept {
    return kMaxEntries > records ? kMaxEntries : records;
  }

 private:
  struct Rectangle {
    glm::uvec4 px;
    std::uint32_t number = 0;
  };
  void add(const glm::uvec4& px, std::uint32_t number) noexcept;
  /// First and last screen tile of a rectangle: first column, first row, last column, last row.
  [[nodiscard]] glm::uvec4 tiles_of(const glm::uvec4& px) const noexcept;
  /// Number of entries at the present size of screen tiles.
  [[nodiscard]] std::size_t count_entries() const noexcept;

  glm::uvec4 window_px_{0U};
  std::uint32_t tile_px_ = kMinPx;
  std::uint32_t columns_ = 0;
  std::uint32_t exposure_tiles_ = 0;
  std::uint32_t shadow_maps_ = 0;
  std::vector<Rectangle> rectangles_;
  std::vector<gpu::ShadeTile> all_;  ///< screen tiles, with those that nothing reaches
  std::vector<gpu::ShadeTile> tiles_;
  std::vector<std::uint16_t> entries_;
  std::size_t used_entries_ = 0;
};

}  // namespace emit::renderer
