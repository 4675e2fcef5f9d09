// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/entity_casts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_int2.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

namespace emit::renderer {
namespace {

/// An entity counts as not moved while it is closer than this to its pose at restart().
constexpr double kStayedM = 0.05;
constexpr double kStayedRad = 5e-3;
/// Least number of texels along the diagonal of an entity's box. The level of the tiles follows
/// from it.
constexpr float kTexelsPerDiagonal = 64.0F;
constexpr int kFinestLevel = -8;
constexpr int kCoarsestLevel = 10;
/// Number of levels by which tiles of a long shadow may be coarser than the entity's diagonal asks.
constexpr int kMaxCoarser = 4;
/// Largest number of tiles that an entity may shade from one place.
constexpr std::size_t kMaxCells = 24;
/// Places of an entity that are farther apart than this share of its diagonal would leave gaps in
/// the shade.
constexpr float kMaxGapFrac = 0.5F;
/// Longest way of an entity between two places of a step, in texels. A longer way takes more
/// places.
constexpr float kPlaceTexels = 4.0F;
/// Smallest rise of a shaded height that is recorded, in m.
constexpr float kTopStepM = 0.02F;

/// Level of the tiles for an entity of that diagonal: texels are 2^level m wide.
int level_of(float diagonal_m) noexcept {
  return std::clamp(static_cast<int>(std::floor(std::log2(diagonal_m / kTexelsPerDiagonal))),
                    kFinestLevel, kCoarsestLevel);
}

/// Returns true if the shadow of an entity, penumbra included, may touch the cell of a tile.
bool meets(const PlacedShadowMap& placed, float texel_m, const glm::ivec2& cell,
           float plane_m) noexcept {
  const float own_m = texel_m * ExposureTile::kOwnSide;
  glm::vec2 low(std::numeric_limits<float>::infinity());
  glm::vec2 high = -low;
  // Project the cell's corners, its rim included, onto the entity shadow depth map.
  float depth_m = 0.0F;
  for (int i = 0; i < 4; ++i) {
    const glm::vec2 corner((i & 1) != 0 ? 1.0F : 0.0F, (i & 2) != 0 ? 1.0F : 0.0F);
    const glm::vec2 rim_m = texel_m * (2.0F * corner - 1.0F);
    const glm::vec4 p(own_m * (glm::vec2(cell) + corner) + rim_m, plane_m, 1.0F);
    const glm::vec2 at(glm::dot(placed.column, p), glm::dot(placed.row, p));
    low = glm::min(low, at);
    high = glm::max(high, at);
    depth_m = std::max(depth_m, glm::dot(placed.depth_m, p));
  }
  // Compare with the box of the map's filled texels, widened by the penumbra.
  constexpr float kMiddle = 0.5F * EntityShadowMaps::kSide;
  const glm::vec2 half = placed.half + penumbra_texels(placed, depth_m);
  return glm::all(glm::lessThanEqual(low, kMiddle + half)) &&
         glm::all(glm::greaterThanEqual(high, kMiddle - half));
}

/// Records that points at a texel and at its neighbours are shaded up to a height above the plane.
void raise(ExposureTile& tile, int x, int y, float top_m) noexcept {
  // Raise the neighbours too, because shade is interpolated between texels.
  constexpr auto kLast = static_cast<int>(ExposureTile::kSide) - 1;
  for (int row = std::max(0, y - 1); row <= std::min(kLast, y + 1); ++row) {
    for (int column = std::max(0, x - 1); column <= std::min(kLast, x + 1); ++column) {
      float& here_m = tile.top_m[static_cast<std::size_t>(row) * ExposureTile::kSide +
                                 static_cast<std::size_t>(column)];
      here_m = std::max(here_m, top_m);
    }
  }
  tile.top_changed = true;
}

}  // namespace

EntityCasts::EntityCasts(std::size_t entities, const ShadeEffect& effect)
    : effect_(effect),
      places_(entities * kMaxPlaces),
      place_count_(entities, 0),
      at_start_(entities) {
  casts_.reserve(entities * kMaxCasts);
}

void EntityCasts::restart(std::int64_t now_ns, std::span<const PoseHistory> entities) noexcept {
  for (std::size_t m = 0; m < entities.size(); ++m) at_start_[m] = entities[m].at(now_ns);
}

bool EntityCasts::list(const ExposureStep& step, const glm::dvec3& to_sun,
                       const ExposureInputs& inputs, ExposureTilePool& pool,
                       TileVertices& vertices) noexcept {
  bool lost = false;
  for (const bool moved : {true, false}) {
    for (std::size_t m = 0; m < inputs.entities.size(); ++m) {
      if (has_moved(m, inputs.entities[m], step.end_ns) != moved) continue;
      lost |= cast(m, moved, step, to_sun, inputs, pool, vertices);
    }
  }
  return lost;
}

bool EntityCasts::has_moved(std::size_t entity, const PoseHistory& poses,
                            std::int64_t at_ns) const noexcept {
  const TrajectoryState& then = at_start_[entity];
  const TrajectoryState now = poses.at(at_ns);
  return now.on != then.on || !physics::close(now.pose, then.pose, kStayedM, kStayedRad);
}

bool EntityCasts::cast(std::size_t entity, bool moved, const ExposureStep& step,
                       const glm::dvec3& to_sun, const ExposureInputs& inputs,
                       ExposureTilePool& pool, TileVertices& vertices) noexcept {
  const std::int64_t begin_ns = step.begin_ns();
  const std::int64_t end_ns = step.end_ns;
  const PoseHistory& poses = inputs.entities[entity];
  const glm::dvec3& origin_m = inputs.rays.origin_world_m();
  const auto placement_at = [&](std::int64_t at_ns) {
    return placement_of(poses.at(at_ns), origin_m);
  };
  // Leave out an entity that is away or has no surface.
  place_count_[entity] = 0;
  const EntityPlacement middle = placement_at(step.middle_ns());
  const float diagonal_m = inputs.shadow_maps.diagonal_m(entity);
  if (!middle.on || !(diagonal_m > 0.0F)) return false;
  // Leave out an entity that is so fast that its places would leave gaps. Report a loss if its
  // shade would have changed the temperature by more than the tolerance.
  const float way_m =
      glm::distance(placement_at(begin_ns).position_m, placement_at(end_ns).position_m);
  if (way_m > kMaxGapFrac * diagonal_m * kMaxPlaces) {
    const auto window_s = static_cast<float>(1e-9 * static_cast<double>(end_ns - begin_ns));
    return moved && effect_.passing_k(window_s * diagonal_m / way_m) > effect_.tolerance_k();
  }
  // Bring its shadow depth map up to date for the middle of the step.
  const glm::vec3 sun(to_sun);
  const bool sharp =
      inputs.shadow_maps.look(entity, sun * middle.rel_from_body, EntityShadowMaps::kSmearedRad,
                              inputs.rays, inputs.workers);
  bool lost = moved && !sharp;
  // Choose the number of places, a power of two, so that they are a few texels apart.
  const float texel_m = std::ldexp(1.0F, level_of(diagonal_m));
  std::uint32_t places = 1;
  while (places < kMaxPlaces && way_m > kPlaceTexels * texel_m * static_cast<float>(places)) {
    places *= 2;
  }
  cast_on_.reset();
  for (std::uint32_t i = 0; i < places; ++i) {
    const EntityPlacement placement =
        placement_at(begin_ns + (end_ns - begin_ns) * (2 * i + 1) / (2 * places));
    if (!placement.on) continue;
    const PlacedShadowMap placed = inputs.shadow_maps.place(entity, placement, sun);
    places_[entity * kMaxPlaces + place_count_[entity]++] = {placed, i, places};
    // Find the ground behind it, along the sun's rays.
    const CasterRay behind{inputs.shadow_maps.middle_m(entity, placement), -sun};
    std::array<CasterHit, 1> hit;
    if (inputs.rays.first_hits({&behind, 1}, {true, {}}, hit) == 0) continue;
    const float ground_m = behind.origin_m.z - hit[0].distance_m * sun.z;
    const float top_m = placement.position_m.z + inputs.shadow_maps.top_m(entity, placement);
    const Caster caster{entity, moved, placed, ground_m, top_m};
    lost |= find_tiles(caster, step, inputs, pool, vertices);
  }
  return lost;
}

bool EntityCasts::find_tiles(const Caster& caster, const ExposureStep& step,
                             const ExposureInputs& inputs, ExposureTilePool& pool,
                             TileVertices& vertices) noexcept {
  const auto& [entity, moved, placed, ground_m, top_m] = caster;
  const ShadedBox box = shaded_box(placed, ground_m);
  int level = level_of(inputs.shadow_maps.diagonal_m(entity));
  float texel_m = std::ldexp(1.0F, level);
  glm::ivec2 first(0);
  glm::ivec2 last(-1);
  // Widen the texels until few enough tiles hold the shadow: a long shadow needs coarser ones.
  for (int coarser = 0;; ++coarser) {
    const float own_m = texel_m * ExposureTile::kOwnSide;
    const glm::vec2 size = (box.high_m - box.low_m) / own_m;
    if (std::max(size.x, size.y) < static_cast<float>(kMaxCells)) {
      first = glm::ivec2(glm::floor((box.low_m - texel_m) / own_m));
      last = glm::ivec2(glm::floor((box.high_m + texel_m) / own_m));
      const glm::ivec2 count = last - first + 1;
      if (count.x * count.y <= static_cast<int>(kMaxCells)) break;
    }
    if (coarser == kMaxCoarser) return moved;
    ++level;
    texel_m *= 2.0F;
  }
  // List every tile that the shadow touches, and take new ones.
  bool lost = false;
  for (int y = first.y; y <= last.y; ++y) {
    for (int x = first.x; x <= last.x; ++x) {
      if (!meets(placed, texel_m, {x, y}, ground_m)) continue;
      const ExposureTilePool::Key key{level, {x, y}};
      ExposureTile* tile = pool.find(key);
      if (tile == nullptr) {
        const auto taken = pool.take(key, top_m, step, moved, inputs.rays, vertices);
        lost |= taken.lost;
        if (taken.tile == nullptr) continue;
        tile = taken.tile;
      }
      tile->cast_turn = step.turn;
      if (moved) tile->moved_turn = step.turn;
      tile->reach_m = std::max(tile->reach_m, std::min(top_m, vertices.highest_m()) -
                                                  tile->plane_m + ExposureTile::kReachMarginM);
      const std::size_t index = pool.index_of(*tile);
      if (cast_on_[index]) continue;
      if (casts_.size() == casts_.capacity()) return lost || moved;
      cast_on_[index] = true;
      casts_.push_back({static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(entity)});
    }
  }
  return lost;
}

void EntityCasts::shade(ExposureTile& tile, std::size_t index, float flux_frac,
                        const glm::vec4& gain, const EntityShadowMaps& shadow_maps) const noexcept {
  constexpr std::uint32_t kSide = ExposureTile::kSide;
  // Add up the shaded share of each texel, over all entities that cast on the tile and all of their
  // places.
  constexpr auto kLast = static_cast<int>(kSide) - 1;
  for (const Cast& cast : casts_) {
    if (cast.tile != index) continue;
    const std::uint32_t places = place_count_[cast.entity];
    for (std::uint32_t p = 0; p < places; ++p) {
      const auto& [placed, number, of] = places_[cast.entity * kMaxPlaces + p];
      const ShadedBox box = shaded_box(placed, tile.plane_m);
      constexpr auto kEnd = static_cast<float>(kSide);
      const auto texel_of = [&](const glm::vec2& at_m, float aside) {
        return glm::clamp((at_m - tile.first_m) / tile.texel_m + aside, -1.0F, kEnd);
      };
      // Visit only the texels that this place may shade.
      const glm::ivec2 first = glm::max(glm::ivec2(glm::floor(texel_of(box.low_m, -1.0F))), 0);
      const glm::ivec2 last = glm::min(glm::ivec2(glm::floor(texel_of(box.high_m, 1.0F))), kLast);
      // Express a texel's place on the depth map as origin + x * right + y * up.
      const auto line = [&](const glm::vec4& axis) {
        return glm::dot(axis, glm::vec4(tile.first_m, tile.plane_m, 1.0F));
      };
      const glm::vec3 origin(line(placed.column), line(placed.row), line(placed.depth_m));
      const glm::vec3 right =
          tile.texel_m * glm::vec3(placed.column.x, placed.row.x, placed.depth_m.x);
      const glm::vec3 up =
          tile.texel_m * glm::vec3(placed.column.y, placed.row.y, placed.depth_m.y);
      for (int y = first.y; y <= last.y; ++y) {
        float* row = &tile.target[static_cast<std::size_t>(y) * kSide];
        const float* tops_m = &tile.top_m[static_cast<std::size_t>(y) * kSide];
        float found = 0.0F;
        for (int x = first.x; x <= last.x; ++x) {
          const glm::vec3 at = origin + static_cast<float>(x) * right + static_cast<float>(y) * up;
          const float frac = shadow_maps.shaded_frac(cast.entity, at.x, at.y, at.z,
                                                     penumbra_texels(placed, at.z), number, of);
          if (frac == 0.0F) continue;
          row[x] += frac;
          found += frac;
          // Record how high the shade begins: everything deeper along this ray is shaded.
          const float top_m =
              (shadow_maps.caster_m(cast.entity, at.x, at.y) - at.z) * placed.depth_m.z;
          if (top_m > tops_m[x] + kTopStepM) raise(tile, x, y, top_m);
        }
        if (found > 0.0F) tile.marked[static_cast<std::size_t>(y)] = 1;
      }
    }
  }
  // Advance the modes of the texels: exact for shade that is constant over the step.
  glm::vec4 most(0.0F);
  for (std::size_t y = 0; y < kSide; ++y) {
    if (tile.marked[y] == 0) continue;
    glm::vec4* shade = &tile.shade[y * kSide];
    float* target = &tile.target[y * kSide];
    for (std::size_t x = 0; x < kSide; ++x) {
      const glm::vec4 before = tile.left_frac * shade[x];
      shade[x] = before + gain * (flux_frac * std::min(target[x], 1.0F) - before);
      most = glm::max(most, shade[x]);
      target[x] = 0.0F;
    }
  }
  tile.most = most;
  tile.left_frac = glm::vec4(1.0F);
  tile.changed = true;
}

}  // namespace emit::renderer
