// SPDX-License-Identifier: Apache-2.0
#include "passes/shade_tiles.hpp"

#include <algorithm>

namespace emit::renderer {

ShadeTiles::ShadeTiles(std::size_t records) {
  rectangles_.reserve(records);
  all_.reserve(kMaxTiles);
  tiles_.reserve(kMaxTiles);
  entries_.resize(max_entries(records));
}

void ShadeTiles::begin(const glm::uvec4& window_px) noexcept {
  EMIT_CHECK_OP(window_px.z, <=, 65536U);
  EMIT_CHECK_OP(window_px.w, <=, 65536U);
  window_px_ = window_px;
  exposure_tiles_ = 0;
  shadow_maps_ = 0;
  rectangles_.clear();
  tiles_.clear();
  used_entries_ = 0;
}

void ShadeTiles::add_exposure_tile(const glm::uvec4& px) noexcept {
  EMIT_CHECK_OP(shadow_maps_, ==, 0U);
  add(px, exposure_tiles_++);
}

void ShadeTiles::add(const glm::uvec4& px, std::uint32_t number) noexcept {
  EMIT_CHECK_OP(number, <, 65536U);
  EMIT_CHECK_OP(rectangles_.size(), <, rectangles_.capacity());
  EMIT_CHECK(window_px_.x <= px.x && px.x < px.z && px.z <= window_px_.z);
  EMIT_CHECK(window_px_.y <= px.y && px.y < px.w && px.w <= window_px_.w);
  rectangles_.push_back({px, number});
}

glm::uvec4 ShadeTiles::tiles_of(const glm::uvec4& px) const noexcept {
  return {(px.x - window_px_.x) / tile_px_, (px.y - window_px_.y) / tile_px_,
          (px.z - 1 - window_px_.x) / tile_px_, (px.w - 1 - window_px_.y) / tile_px_};
}

std::size_t ShadeTiles::count_entries() const noexcept {
  std::size_t count = 0;
  for (const Rectangle& rectangle : rectangles_) {
    const glm::uvec4 tiles = tiles_of(rectangle.px);
    count += std::size_t{tiles.z - tiles.x + 1} * (tiles.w - tiles.y + 1);
  }
  return count;
}

void ShadeTiles::sort() noexcept {
  if (rectangles_.empty()) return;
  // Choose the smallest screen tiles that keep to both limits.
  const glm::uvec2 size_px(window_px_.z - window_px_.x, window_px_.w - window_px_.y);
  std::size_t rows = 0;
  for (tile_px_ = kMinPx;; tile_px_ *= 2) {
    columns_ = (size_px.x + tile_px_ - 1) / tile_px_;
    rows = (size_px.y + tile_px_ - 1) / tile_px_;
    if (columns_ * rows <= kMaxTiles && count_entries() <= entries_.size()) break;
  }
  all_.assign(columns_ * rows, {});
  const auto for_each = [this](const auto& visit) {
    for (std::size_t i = 0; i < rectangles_.size(); ++i) {
      const glm::uvec4 tiles = tiles_of(rectangles_[i].px);
      for (std::uint32_t y = tiles.y; y <= tiles.w; ++y) {
        for (std::uint32_t x = tiles.x; x <= tiles.z; ++x) {
          visit(all_[std::size_t{y} * columns_ + x], i < exposure_tiles_, rectangles_[i].number);
        }
      }
    }
  };
  // Count the rectangles of each screen tile.
  for_each([](gpu::ShadeTile& tile, bool exposure_tile, std::uint32_t) {
    ++(exposure_tile ? tile.exposure_tiles : tile.shadow_maps);
  });
  // Give each screen tile its part of the list.
  std::uint32_t first = 0;
  for (gpu::ShadeTile& tile : all_) {
    tile.first = first;
    first += tile.exposure_tiles + tile.shadow_maps;
  }
  used_entries_ = first;
  // Fill in the numbers. Rectangles come in the order of their entries, and `first` is the next
  // free one.
  for_each([this](gpu::ShadeTile& tile, bool, std::uint32_t number) {
    entries_[tile.first++] = static_cast<std::uint16_t>(number);
  });
  // Keep the screen tiles that something reaches, with `first` set back to the first entry.
  for (std::size_t i = 0; i < all_.size(); ++i) {
    gpu::ShadeTile& tile = all_[i];
    const std::uint32_t count = tile.exposure_tiles + tile.shadow_maps;
    if (count == 0) continue;
    tile.first -= count;
    const glm::uvec2 place_px =
        glm::uvec2(window_px_) + tile_px_ * glm::uvec2(i % columns_, i / columns_);
    tile.place_px = place_px.x | place_px.y << 16U;
    tiles_.push_back(tile);
  }
}

}  // namespace emit::renderer
