// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/exposure_tile_pool.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

namespace emit::renderer {
namespace {

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min() / 2;
/// Depth below the plane, as a share of the tile's side, to which a tile shades ground. Lower
/// ground belongs to another surface.
constexpr float kLowestFrac = 0.25F;
/// A tile that holds less than this, in tolerances, is given back.
constexpr float kMinEffectFrac = 0.5F;

/// Makes a tile an empty one on a plane. `lowest_m` is the height of the lowest vertex.
void begin_tile(ExposureTile& tile, const ExposureTilePool::Key& key, float plane_m,
                float lowest_m) noexcept {
  const float texel_m = std::ldexp(1.0F, key.level);
  const float own_m = texel_m * ExposureTile::kOwnSide;
  tile.used = true;
  tile.level = key.level;
  tile.cell = key.cell;
  tile.texel_m = texel_m;
  tile.first_m = own_m * glm::vec2(key.cell) - 0.5F * texel_m;
  tile.plane_m = plane_m;
  tile.reach_m = 0.0F;
  tile.lowest_m = std::max(-kLowestFrac * own_m, lowest_m - plane_m - ExposureTile::kReachMarginM);
  tile.left_frac = glm::vec4(1.0F);
  tile.most = glm::vec4(0.0F);
  tile.vertices_ns = kNever;
  tile.moved_turn = kNever;
  tile.changed = tile.top_changed = true;
  std::ranges::fill(tile.shade, glm::vec4(0.0F));
  std::ranges::fill(tile.top_m, ExposureTile::kReachMarginM);
  tile.marked.fill(0);
}

}  // namespace

ExposureTilePool::ExposureTilePool(std::size_t entities, const ShadeEffect& effect)
    : effect_(effect), tiles_(entities > 0 ? kTiles : 0) {
  constexpr std::size_t kTexels = std::size_t{ExposureTile::kSide} * ExposureTile::kSide;
  // Take all memory now, because steps must not allocate.
  for (ExposureTile& tile : tiles_) {
    tile.shade.assign(kTexels, glm::vec4(0.0F));
    tile.target.assign(kTexels, 0.0F);
    tile.top_m.assign(kTexels, 0.0F);
    tile.vertices.reserve(ExposureTile::kMaxVertices);
  }
}

ExposureTile* ExposureTilePool::find(const Key& key) noexcept {
  const auto found = std::ranges::find(keys_, key);
  return found != keys_.end() ? &tiles_[static_cast<std::size_t>(found - keys_.begin())] : nullptr;
}

ExposureTilePool::Taken ExposureTilePool::take(const Key& key, float top_m,
                                               const ExposureStep& step, bool moved,
                                               const CasterRays& rays,
                                               TileVertices& vertices) noexcept {
  const auto [tile, lost] = choose(step.turn, moved);
  if (tile == nullptr) return {nullptr, lost};
  if (tile->used) give_back(*tile, vertices);
  const std::optional<float> plane_m = plane_of(key, top_m, rays);
  if (!plane_m) return {nullptr, lost};
  begin_tile(*tile, key, *plane_m, vertices.lowest_m());
  const std::size_t index = index_of(*tile);
  tile->at_turn = step.turn_before(index);
  keys_[index] = key;
  return {tile, lost};
}

void ExposureTilePool::give_back(ExposureTile& tile, TileVertices& vertices) noexcept {
  vertices.hide(tile);
  tile.used = false;
  keys_[index_of(tile)].level = kNoLevel;
}

bool ExposureTilePool::holds_little(const ExposureTile& tile) const noexcept {
  return effect_k(tile) < kMinEffectFrac * effect_.tolerance_k();
}

ExposureTilePool::Taken ExposureTilePool::choose(std::int64_t turn, bool moved) noexcept {
  const auto unused = std::ranges::find(keys_, kNoLevel, &Key::level);
  if (unused != keys_.end()) {
    return {&tiles_[static_cast<std::size_t>(unused - keys_.begin())], false};
  }
  if (!moved) return {};
  // Find the tile that holds least, among those on which no moved entity casts now.
  ExposureTile* least = nullptr;
  for (ExposureTile& tile : tiles_) {
    if (tile.moved_turn > turn - ExposureStep::kTurns) continue;
    if (least == nullptr || effect_k(tile) < effect_k(*least)) least = &tile;
  }
  // Report a loss if there is no such tile, or if it holds shade that matters.
  return {least, least == nullptr ||
                     (least->moved_turn > kNever && effect_k(*least) > effect_.tolerance_k())};
}

std::optional<float> ExposureTilePool::plane_of(const Key& key, float top_m,
                                                const CasterRays& rays) const noexcept {
  const float own_m = std::ldexp(1.0F, key.level) * ExposureTile::kOwnSide;
  const glm::vec2 middle_m = own_m * (glm::vec2(key.cell) + 0.5F);
  // Send five rays down, to the centre of the square and to the centres of its quarters.
  std::array<CasterRay, 5> down;
  for (std::size_t i = 0; i < down.size(); ++i) {
    const glm::vec2 aside((i & 1U) != 0U ? 0.25F : -0.25F, (i & 2U) != 0U ? 0.25F : -0.25F);
    down[i] = {{middle_m + (i < 4 ? own_m * aside : glm::vec2(0.0F)), top_m}, {0.0F, 0.0F, -1.0F}};
  }
  std::array<CasterHit, down.size()> hits;
  const std::uint32_t met = rays.first_hits(down, {true, {}}, hits);
  if (met == 0) return std::nullopt;
  // Take the lowest hit: things that stand on the ground are shaded along the same rays.
  float plane_m = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < down.size(); ++i) {
    if (((met >> i) & 1U) != 0) plane_m = std::min(plane_m, top_m - hits[i].distance_m);
  }
  // Adopt the plane of a neighbour that is close, so that each ray of the sun belongs to one tile.
  float nearest_m = 0.5F * kLowestFrac * own_m;
  std::optional<float> neighbours_m;
  for (const ExposureTile& tile : tiles_) {
    if (!tile.used || tile.level != key.level ||
        glm::any(glm::greaterThan(glm::abs(tile.cell - key.cell), glm::ivec2(1)))) {
      continue;
    }
    if (std::abs(tile.plane_m - plane_m) > nearest_m) continue;
    nearest_m = std::abs(tile.plane_m - plane_m);
    neighbours_m = tile.plane_m;
  }
  return neighbours_m.value_or(plane_m);
}

float ExposureTilePool::effect_k(const ExposureTile& tile) const noexcept {
  return effect_.of_shade_k(tile.left_frac * tile.most);
}

}  // namespace emit::renderer
