// SPDX-License-Identifier: Apache-2.0
#include "passes/shade_tiles.hpp"

#include <algorithm>

namespace emit::renderer {

ShadeTiles::ShadeTiles(std::size_t records) {
  rectangles_.reserve(records);
  all_.reserve(kMostTiles);
  tiles_.reserve(kMostTiles);
  entries_.resize(most_entries(records));
}

void ShadeTiles::begin(const glm::uvec4& window_px) noexcept {
  window_px_ = window_px;
  pages_ = 0;
  silhouettes_ = 0;
  rectangles_.clear();
  tiles_.clear();
  used_entries_ = 0;
}

void ShadeTiles::add(const glm::uvec4& px, std::uint32_t number) noexcept {
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
  const glm::uvec2 size_px(window_px_.z - window_px_.x, window_px_.w - window_px_.y);
  std::size_t rows = 0;
  for (tile_px_ = kLeastPx;; tile_px_ *= 2) {
    columns_ = (size_px.x + tile_px_ - 1) / tile_px_;
    rows = (size_px.y + tile_px_ - 1) / tile_px_;
    if (columns_ * rows <= kMostTiles && count_entries() <= entries_.size()) break;
  }
  all_.assign(columns_ * rows, {});
  const auto for_each = [this](const auto& visit) {
    for (std::size_t i = 0; i < rectangles_.size(); ++i) {
      const glm::uvec4 tiles = tiles_of(rectangles_[i].px);
      for (std::uint32_t y = tiles.y; y <= tiles.w; ++y) {
        for (std::uint32_t x = tiles.x; x <= tiles.z; ++x) {
          visit(all_[std::size_t{y} * columns_ + x], i < pages_, rectangles_[i].number);
        }
      }
    }
  };
  for_each([](gpu::ShadeTile& tile, bool page, std::uint32_t) {
    ++(page ? tile.pages : tile.silhouettes);
  });
  std::uint32_t first = 0;
  for (gpu::ShadeTile& tile : all_) {
    tile.first = first;
    first += tile.pages + tile.silhouettes;
  }
  used_entries_ = first;
  // Rectangles come in the order of their entries: `first` is where the next one goes.
  for_each([this](gpu::ShadeTile& tile, bool, std::uint32_t number) {
    entries_[tile.first++] = static_cast<std::uint16_t>(number);
  });
  for (std::size_t i = 0; i < all_.size(); ++i) {
    gpu::ShadeTile& tile = all_[i];
    const std::uint32_t count = tile.pages + tile.silhouettes;
    if (count == 0) continue;
    tile.first -= count;
    const glm::uvec2 place_px =
        glm::uvec2(window_px_) + tile_px_ * glm::uvec2(i % columns_, i / columns_);
    tile.place_px = place_px.x | place_px.y << 16U;
    tiles_.push_back(tile);
  }
}

}  // namespace emit::renderer
