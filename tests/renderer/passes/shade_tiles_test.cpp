// SPDX-License-Identifier: Apache-2.0
// ShadeTiles: each pixel finds the rectangles it lies in, in their order and once.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "passes/shade_tiles.hpp"

namespace emit::test {
namespace {

using renderer::ShadeTiles;

/// Rectangles of both kinds.
struct Rectangles {
  std::vector<glm::uvec4> exposure_tiles;
  std::vector<glm::uvec4> shadow_maps;
};

/// Random rectangles within a window.
Rectangles random_rectangles(const glm::uvec4& window_px, std::size_t exposure_tiles,
                             std::size_t shadow_maps, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto within = [&](std::uint32_t first, std::uint32_t behind) {
    std::uniform_int_distribution<std::uint32_t> some(first, behind);
    const std::uint32_t a = some(random);
    const std::uint32_t b = some(random);
    return a != b ? std::pair(std::min(a, b), std::max(a, b)) : std::pair(first, behind);
  };
  const auto rectangle = [&] {
    const auto [left, right] = within(window_px.x, window_px.z);
    const auto [low, high] = within(window_px.y, window_px.w);
    return glm::uvec4(left, low, right, high);
  };
  Rectangles out;
  for (std::size_t i = 0; i < exposure_tiles; ++i) out.exposure_tiles.push_back(rectangle());
  for (std::size_t i = 0; i < shadow_maps; ++i) out.shadow_maps.push_back(rectangle());
  return out;
}

/// Sorts rectangles into screen tiles.
void sort(ShadeTiles& tiles, const glm::uvec4& window_px, const Rectangles& rectangles) {
  tiles.begin(window_px);
  for (const glm::uvec4& px : rectangles.exposure_tiles) tiles.add_exposure_tile(px);
  for (const glm::uvec4& px : rectangles.shadow_maps) tiles.add_entity_shadow(px);
  tiles.sort();
}

/// True when a rectangle holds a pixel.
bool lies_in(const glm::uvec2& px, const glm::uvec4& rectangle_px) {
  return px.x >= rectangle_px.x && px.x < rectangle_px.z && px.y >= rectangle_px.y &&
         px.y < rectangle_px.w;
}

/// Expects that a screen tile names every rectangle that holds the pixel once, and all in order.
void expect_named(std::span<const std::uint16_t> entries, const glm::uvec2& px,
                  const std::vector<glm::uvec4>& rectangles) {
  EXPECT_TRUE(std::ranges::is_sorted(entries, std::ranges::less_equal{}));
  for (std::uint16_t i = 0; i < rectangles.size(); ++i) {
    EXPECT_TRUE(!lies_in(px, rectangles[i]) || std::ranges::count(entries, i) == 1);
  }
  for (const std::uint16_t entry : entries) EXPECT_LT(entry, rectangles.size());
}

/// Expects that every `stride`th pixel lies in at most one screen tile, which names its rectangles.
void expect_every_pixel_finds_its_own(const ShadeTiles& tiles, const glm::uvec4& window_px,
                                      const Rectangles& rectangles, std::uint32_t stride) {
  const std::uint32_t tile_px = tiles.tile_px();
  for (std::uint32_t y = window_px.y; y < window_px.w; y += stride) {
    for (std::uint32_t x = window_px.x; x < window_px.z; x += stride) {
      const glm::uvec2 px(x, y);
      std::size_t found = 0;
      for (const renderer::gpu::ShadeTile& tile : tiles.tiles()) {
        const glm::uvec2 place(tile.place_px & 0xffffU, tile.place_px >> 16U);
        if (!lies_in(px, glm::uvec4(place, place + tile_px))) continue;
        ++found;
        const auto entries =
            tiles.entries().subspan(tile.first, tile.exposure_tiles + tile.shadow_maps);
        expect_named(entries.first(tile.exposure_tiles), px, rectangles.exposure_tiles);
        expect_named(entries.subspan(tile.exposure_tiles), px, rectangles.shadow_maps);
      }
      const auto in_any = [&](const std::vector<glm::uvec4>& all) {
        return std::ranges::any_of(all, [&](const glm::uvec4& each) { return lies_in(px, each); });
      };
      EXPECT_LE(found, 1U);
      const bool reached = in_any(rectangles.exposure_tiles) || in_any(rectangles.shadow_maps);
      EXPECT_GE(found, reached ? 1U : 0U);
    }
  }
}

TEST(ShadeTiles, EveryPixelFindsWhatItLiesInOnceAndInOrder) {
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    const glm::uvec4 window_px(seed, 3 * seed, 200 + seed, 170);
    const Rectangles rectangles = random_rectangles(window_px, 7, 3, seed);
    ShadeTiles tiles(10);
    sort(tiles, window_px, rectangles);
    EXPECT_EQ(tiles.tile_px(), ShadeTiles::kMinPx);
    expect_every_pixel_finds_its_own(tiles, window_px, rectangles, 1);
  }
}

TEST(ShadeTiles, SquaresThatNothingReachesAreLeftOut) {
  constexpr std::uint32_t kPx = ShadeTiles::kMinPx;
  ShadeTiles tiles(2);
  sort(tiles, {0, 0, 20 * kPx, 20 * kPx},
       {{{kPx, kPx, 3 * kPx, 2 * kPx}}, {{2 * kPx, kPx, 2 * kPx + 1, kPx + 1}}});
  ASSERT_EQ(tiles.tiles().size(), 2U);
  EXPECT_EQ(tiles.tiles()[0].place_px, kPx | kPx << 16U);
  EXPECT_EQ(tiles.tiles()[0].exposure_tiles, 1U);
  EXPECT_EQ(tiles.tiles()[0].shadow_maps, 0U);
  EXPECT_EQ(tiles.tiles()[1].place_px, 2 * kPx | kPx << 16U);
  EXPECT_EQ(tiles.tiles()[1].shadow_maps, 1U);
  sort(tiles, {0, 0, kPx, kPx}, {});
  EXPECT_TRUE(tiles.tiles().empty());
  EXPECT_TRUE(tiles.entries().empty());
}

TEST(ShadeTiles, LargePicturesHaveLargerSquares) {
  const glm::uvec4 window_px(0, 0, 8192, 8192);
  const Rectangles rectangles = random_rectangles(window_px, 5, 2, 9);
  ShadeTiles tiles(7);
  sort(tiles, window_px, rectangles);
  EXPECT_GT(tiles.tile_px(), ShadeTiles::kMinPx);
  EXPECT_LE(tiles.tiles().size(), ShadeTiles::kMaxTiles);
  expect_every_pixel_finds_its_own(tiles, window_px, rectangles, 97);
}

TEST(ShadeTiles, WhereEntriesRunOutSquaresAreLargerAndNothingIsLost) {
  const glm::uvec4 window_px(0, 0, 640, 512);
  Rectangles rectangles;
  rectangles.exposure_tiles.assign(128, window_px);
  rectangles.shadow_maps.assign(60'000, window_px);
  const std::size_t records = rectangles.exposure_tiles.size() + rectangles.shadow_maps.size();
  ShadeTiles tiles(records);
  sort(tiles, window_px, rectangles);
  std::size_t entries = 0;
  for (const auto& tile : tiles.tiles()) entries += tile.exposure_tiles + tile.shadow_maps;
  EXPECT_LE(tiles.entries().size(), ShadeTiles::max_entries(records));
  EXPECT_EQ(entries, tiles.entries().size());
  ASSERT_EQ(tiles.tiles().size(), 1U);
  EXPECT_EQ(tiles.tiles()[0].exposure_tiles, 128U);
  EXPECT_EQ(tiles.tiles()[0].shadow_maps, 60'000U);
}

}  // namespace
}  // namespace emit::test
