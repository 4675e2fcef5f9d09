// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/exposure_tiles.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <utility>

namespace emit::renderer {
namespace {

/// An entity counts as not moved while it is closer than this to its pose at restart().
constexpr double kStayedM = 0.05;
constexpr double kStayedRad = 5e-3;
/// Sine of the lowest sun that tiles are made for. A lower sun draws shadows too long for them and
/// hardly warms level ground.
constexpr double kMinSunSine = 0.05;
/// Least number of texels along the diagonal of an entity's box. The level of the tiles follows
/// from it.
constexpr float kTexelsPerDiagonal = 64.0F;
constexpr int kFinestLevel = -8;
constexpr int kCoarsestLevel = 10;
/// Number of levels by which tiles of a long shadow may be coarser than the entity's diagonal asks.
constexpr int kMaxCoarser = 4;
/// Places of an entity that are farther apart than this share of its diagonal would leave gaps in
/// the shade.
constexpr float kMaxGapFrac = 0.5F;
/// Smallest rise of a shaded height that is recorded, in m.
constexpr float kTopStepM = 0.02F;
/// Smallest change of a vertex that is sent to the device, in K.
constexpr float kMinChangeK = 5e-5F;
/// Longest way of an entity between two places of a step, in texels. A longer way takes more
/// places.
constexpr float kPlaceTexels = 4.0F;
/// Time after which the vertices of a tile are gathered anew: the shadow of a parked entity creeps
/// over vertices that it did not reach before.
constexpr std::int64_t kGatherNs = 10'000'000'000;
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min() / 2;
/// Margin above and below the heights that a tile covers, in m.
constexpr float kReachMarginM = 0.5F;
/// Depth below the plane, as a share of the tile's side, to which a tile shades ground. Lower
/// ground belongs to another surface.
constexpr float kLowestFrac = 0.25F;
/// Limits of the squares by which vertices are found: smallest side, largest number along an axis.
constexpr float kMinSquareM = 4.0F;
constexpr int kMaxSquares = 1024;
/// A tile that holds less than this, in tolerances, is given back.
constexpr float kMinEffectFrac = 0.5F;

/// Share of older shade that is left after `turns` turns, by mode.
glm::vec4 left_after(std::int64_t turns) noexcept {
  const double seconds = 1e-9 * static_cast<double>(turns * ExposureTiles::kTurnNs);
  glm::vec4 left;
  for (std::size_t k = 0; k < ShadeResponse::kModes; ++k) {
    left[static_cast<glm::length_t>(k)] =
        static_cast<float>(std::exp(-seconds / ShadeResponse::kTauS[k]));
  }
  return left;
}

/// Level of the tiles for an entity of that diagonal: texels are 2^level m wide.
int level_of(float diagonal_m) noexcept {
  return std::clamp(static_cast<int>(std::floor(std::log2(diagonal_m / kTexelsPerDiagonal))),
                    kFinestLevel, kCoarsestLevel);
}

glm::ivec2 floor_of(const glm::vec2& v) noexcept {
  return {static_cast<int>(std::floor(v.x)), static_cast<int>(std::floor(v.y))};
}

}  // namespace

ExposureTiles::ExposureTiles(const SurfaceSamples& all, std::uint32_t drawn, ShadeResponse response,
                             std::size_t entities, std::int64_t start_ns, float tolerance_k)
    : response_(std::move(response)),
      tolerance_k_(tolerance_k),
      start_ns_(start_ns),
      tiles_(entities > 0 ? kTiles : 0),
      places_(entities * kMaxPlaces),
      place_count_(entities, 0),
      at_start_(entities) {
  if (entities == 0) return;
  // Find the largest weight of each mode: with it effect_k() bounds all materials.
  for (const glm::vec4& weights : response_.weights_k()) {
    most_weight_k_ = glm::max(most_weight_k_, weights);
  }
  // Take all memory now, because steps must not allocate.
  for (ExposureTile& tile : tiles_) {
    tile.shade.assign(std::size_t{kSide} * kSide, glm::vec4(0.0F));
    tile.target.assign(std::size_t{kSide} * kSide, 0.0F);
    tile.top_m.assign(std::size_t{kSide} * kSide, 0.0F);
    tile.vertices.reserve(kMaxVertices);
  }
  casts_.reserve(entities * kMaxCasts);
  vertices_k_.assign(drawn, 0.0F);
  changes_.add(0, drawn);

  // Find the box of the static vertices.
  glm::vec3 low_m(std::numeric_limits<float>::infinity());
  glm::vec3 high_m = -low_m;
  const auto counts = [&](std::uint32_t i) { return all.samples[i].entity < 0; };
  for (std::uint32_t i = 0; i < drawn; ++i) {
    if (!counts(i)) continue;
    low_m = glm::min(low_m, all.samples[i].position_m);
    high_m = glm::max(high_m, all.samples[i].position_m);
  }
  if (!(low_m.x <= high_m.x)) return;
  lowest_m_ = low_m.z;
  highest_m_ = high_m.z;
  squares_m_ = glm::vec2(low_m);
  square_m_ = std::max(
      {kMinSquareM, (high_m.x - low_m.x) / kMaxSquares, (high_m.y - low_m.y) / kMaxSquares});
  squares_ = floor_of(glm::vec2(high_m - low_m) / square_m_) + 1;
  const auto square_of = [&](std::uint32_t i) {
    const glm::ivec2 at = floor_of((glm::vec2(all.samples[i].position_m) - squares_m_) / square_m_);
    return static_cast<std::size_t>(at.y) * static_cast<std::size_t>(squares_.x) +
           static_cast<std::size_t>(at.x);
  };
  // Sort the vertices by square: count them, add the counts up, then fill.
  first_of_square_.assign(
      static_cast<std::size_t>(squares_.x) * static_cast<std::size_t>(squares_.y) + 1, 0);
  for (std::uint32_t i = 0; i < drawn; ++i) {
    if (counts(i)) ++first_of_square_[square_of(i) + 1];
  }
  for (std::size_t s = 1; s < first_of_square_.size(); ++s) {
    first_of_square_[s] += first_of_square_[s - 1];
  }
  of_square_.resize(first_of_square_.back());
  std::vector<std::uint32_t> next(first_of_square_.begin(), first_of_square_.end() - 1);
  for (std::uint32_t i = 0; i < drawn; ++i) {
    if (counts(i)) of_square_[next[square_of(i)]++] = i;
  }
}

void ExposureTiles::restart(std::int64_t now_ns, std::span<const PoseHistory> entities) noexcept {
  for (std::size_t m = 0; m < entities.size(); ++m) at_start_[m] = entities[m].at(now_ns);
  for (ExposureTile& tile : tiles_) {
    if (tile.used) give_back(tile);
  }
  next_turn_ = std::max<std::int64_t>(0, now_ns - start_ns_) / kTurnNs + 1;
  first_turn_ = next_turn_;
  short_turn_ = next_turn_ - kShortTurns;
}

void ExposureTiles::forget_changes() noexcept {
  changes_.clear();
  for (ExposureTile& tile : tiles_) tile.changed = tile.top_changed = false;
}

void ExposureTiles::run(std::int64_t until_ns, const SurfaceSamples& all,
                        const Inputs& inputs) noexcept {
  if (tiles_.empty()) return;
  first_turn_ = next_turn_;
  const std::int64_t end = std::max<std::int64_t>(0, until_ns - start_ns_) / kTurnNs + 1;
  // Forget everything if sim time went back.
  if (end < next_turn_) {
    restart(until_ns, inputs.entities);
    short_turn_ = next_turn_;
    return;
  }
  // Do normal steps if sim time moves at about its normal rate.
  if (end - next_turn_ <= kTurnsPerFrame) {
    for (; next_turn_ < end; ++next_turn_) {
      take_turn(next_turn_, kTurns, Pace::one_group, all, inputs);
    }
    return;
  }
  // After a long jump, let what the tiles hold fade over the part that is left out.
  if (end - next_turn_ > kMaxWindows * kMaxWindowTurns) {
    next_turn_ = end - kMaxWindows * kMaxWindowTurns;
    for (ExposureTile& tile : tiles_) {
      tile.left_frac *= left_after(next_turn_ - 1 - tile.at_turn);
      tile.at_turn = next_turn_ - 1;
    }
  }
  // Step all tiles over the rest, in a few windows of about equal length.
  const std::int64_t due = end - next_turn_;
  const std::int64_t windows = std::min(kMaxWindows, due / kTurns);
  for (std::int64_t w = windows; w > 0; --w) {
    const std::int64_t turns = (end - next_turn_) / w;
    next_turn_ += turns;
    take_turn(next_turn_ - 1, turns, Pace::all, all, inputs);
  }
}

ExposureTiles::ExposureTile* ExposureTiles::tile_at(int level, const glm::ivec2& cell) noexcept {
  for (std::size_t p = 0; p < keys_.size(); ++p) {
    if (keys_[p].level == level && keys_[p].cell == cell) return &tiles_[p];
  }
  return nullptr;
}

float ExposureTiles::effect_k(const ExposureTile& tile) const noexcept {
  return glm::dot(most_weight_k_, tile.left_frac * tile.most);
}

float ExposureTiles::passing_k(float seconds) const noexcept {
  float sum_k = 0.0F;
  for (std::size_t k = 0; k < ShadeResponse::kModes; ++k) {
    sum_k -= most_weight_k_[static_cast<glm::length_t>(k)] *
             std::expm1(-seconds / static_cast<float>(ShadeResponse::kTauS[k]));
  }
  return sum_k;
}

void ExposureTiles::give_back(ExposureTile& tile) noexcept {
  hide_vertices(tile);
  tile.used = false;
  keys_[static_cast<std::size_t>(&tile - tiles_.data())].level = kNoLevel;
}

bool ExposureTiles::has_moved(std::size_t entity, const PoseHistory& poses,
                              std::int64_t at_ns) const noexcept {
  const TrajectoryState& then = at_start_[entity];
  const TrajectoryState now = poses.at(at_ns);
  return now.on != then.on || !physics::close(now.pose, then.pose, kStayedM, kStayedRad);
}

ExposureTiles::ExposureTile* ExposureTiles::take_tile(std::int64_t turn, bool moved) noexcept {
  ExposureTile* least = nullptr;
  const auto unused = std::ranges::find(keys_, kNoLevel, &Key::level);
  if (unused != keys_.end()) return &tiles_[static_cast<std::size_t>(unused - keys_.begin())];
  // Find the tile that holds least, among those on which no moved entity casts now.
  for (ExposureTile& tile : tiles_) {
    if (!moved || tile.moved_turn > turn - kTurns) continue;
    if (least == nullptr || effect_k(tile) < effect_k(*least)) least = &tile;
  }
  if (!moved) return nullptr;
  // Report a loss if there is no such tile, or if it holds shade that matters.
  if (least == nullptr || (least->moved_turn > kNever && effect_k(*least) > tolerance_k_)) {
    short_turn_ = turn;
  }
  if (least != nullptr) give_back(*least);
  return least;
}

std::optional<float> ExposureTiles::plane_of(int level, const glm::ivec2& cell, float top_m,
                                             const CasterRays& rays) const noexcept {
  const float own_m = std::ldexp(1.0F, level) * kOwnSide;
  const glm::vec2 middle_m = own_m * (glm::vec2(cell) + 0.5F);
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
    if (!tile.used || tile.level != level ||
        glm::any(glm::greaterThan(glm::abs(tile.cell - cell), glm::ivec2(1)))) {
      continue;
    }
    if (std::abs(tile.plane_m - plane_m) > nearest_m) continue;
    nearest_m = std::abs(tile.plane_m - plane_m);
    neighbours_m = tile.plane_m;
  }
  return neighbours_m.value_or(plane_m);
}

bool ExposureTiles::begin(ExposureTile& tile, int level, const glm::ivec2& cell, float top_m,
                          const CasterRays& rays) const noexcept {
  const std::optional<float> plane_m = plane_of(level, cell, top_m, rays);
  if (!plane_m) return false;
  const float texel_m = std::ldexp(1.0F, level);
  const float own_m = texel_m * kOwnSide;
  tile.used = true;
  tile.level = level;
  tile.cell = cell;
  tile.texel_m = texel_m;
  tile.first_m = own_m * glm::vec2(cell) - 0.5F * texel_m;
  tile.plane_m = *plane_m;
  tile.reach_m = 0.0F;
  tile.lowest_m = std::max(-kLowestFrac * own_m, lowest_m_ - *plane_m - kReachMarginM);
  tile.left_frac = glm::vec4(1.0F);
  tile.most = glm::vec4(0.0F);
  tile.vertices_ns = kNever;
  tile.moved_turn = kNever;
  tile.changed = tile.top_changed = true;
  std::ranges::fill(tile.shade, glm::vec4(0.0F));
  std::ranges::fill(tile.top_m, kReachMarginM);
  tile.marked.fill(0);
  return true;
}

void ExposureTiles::cast(std::size_t entity, std::int64_t turn, std::int64_t turns, bool moved,
                         const glm::dvec3& to_sun, const Inputs& inputs) noexcept {
  const std::int64_t end_ns = start_ns_ + turn * kTurnNs;
  const std::int64_t begin_ns = end_ns - turns * kTurnNs;
  const PoseHistory& poses = inputs.entities[entity];
  const glm::dvec3& origin_m = inputs.rays.origin_world_m();
  const auto placement_at = [&](std::int64_t at_ns) {
    const TrajectoryState state = poses.at(at_ns);
    return EntityPlacement{glm::mat3(glm::mat3_cast(state.pose.world_from_body)),
                           glm::vec3(state.pose.position_world_m - origin_m), state.on};
  };
  // Leave out an entity that is away or has no surface.
  place_count_[entity] = 0;
  const EntityPlacement middle = placement_at(begin_ns + (end_ns - begin_ns) / 2);
  const float diagonal_m = inputs.shadow_maps.diagonal_m(entity);
  if (!middle.on || !(diagonal_m > 0.0F)) return;
  // Leave out an entity that is so fast that its places would leave gaps. Report a loss if its
  // shade would have changed the temperature by more than the tolerance.
  const float way_m =
      glm::distance(placement_at(begin_ns).position_m, placement_at(end_ns).position_m);
  if (way_m > kMaxGapFrac * diagonal_m * kMaxPlaces) {
    const auto window_s = static_cast<float>(1e-9 * static_cast<double>(end_ns - begin_ns));
    if (moved && passing_k(window_s * diagonal_m / way_m) > tolerance_k_) short_turn_ = turn;
    return;
  }
  // Bring its shadow depth map up to date for the middle of the step.
  const glm::vec3 sun(to_sun);
  const bool sharp =
      inputs.shadow_maps.look(entity, sun * middle.rel_from_body, EntityShadowMaps::kSmearedRad,
                              inputs.rays, inputs.workers);
  if (!sharp && moved) short_turn_ = turn;
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
    find_tiles(entity, turn, turns, moved, placed, ground_m, top_m, inputs);
  }
}

void ExposureTiles::find_tiles(std::size_t entity, std::int64_t turn, std::int64_t turns,
                               bool moved, const PlacedShadowMap& placed, float ground_m,
                               float top_m, const Inputs& inputs) noexcept {
  const ShadedBox box = shaded_box(placed, ground_m);
  int level = level_of(inputs.shadow_maps.diagonal_m(entity));
  float texel_m = std::ldexp(1.0F, level);
  glm::ivec2 first(0);
  glm::ivec2 last(-1);
  // Widen the texels until few enough tiles hold the shadow: a long shadow needs coarser ones.
  for (int coarser = 0;; ++coarser) {
    const float own_m = texel_m * kOwnSide;
    const glm::vec2 size = (box.high_m - box.low_m) / own_m;
    if (std::max(size.x, size.y) < static_cast<float>(kMaxCells)) {
      first = floor_of((box.low_m - texel_m) / own_m);
      last = floor_of((box.high_m + texel_m) / own_m);
      const glm::ivec2 count = last - first + 1;
      if (count.x * count.y <= static_cast<int>(kMaxCells)) break;
    }
    if (coarser == kMaxCoarser) {
      if (moved) short_turn_ = turn;
      return;
    }
    ++level;
    texel_m *= 2.0F;
  }
  // List every tile that the shadow touches, and take new ones.
  for (int y = first.y; y <= last.y; ++y) {
    for (int x = first.x; x <= last.x; ++x) {
      if (!meets(placed, texel_m, {x, y}, ground_m)) continue;
      ExposureTile* tile = tile_at(level, {x, y});
      if (tile == nullptr) {
        tile = take_tile(turn, moved);
        if (tile == nullptr || !begin(*tile, level, {x, y}, top_m, inputs.rays)) continue;
        keys_[static_cast<std::size_t>(tile - tiles_.data())] = {level, {x, y}};
        // Set the tile back in time, so that its first step is as long as every other one.
        const auto group = static_cast<std::int64_t>(tile - tiles_.data()) % kTurns;
        const std::int64_t wait =
            pace_ == Pace::one_group ? (group - turn % kTurns + kTurns) % kTurns : 0;
        tile->at_turn = turn + wait - turns;
      }
      tile->cast_turn = turn;
      if (moved) tile->moved_turn = turn;
      tile->reach_m =
          std::max(tile->reach_m, std::min(top_m, highest_m_) - tile->plane_m + kReachMarginM);
      const auto index = static_cast<std::size_t>(tile - tiles_.data());
      if (cast_on_[index]) continue;
      if (casts_.size() == casts_.capacity()) {
        if (moved) short_turn_ = turn;
        return;
      }
      cast_on_[index] = true;
      casts_.push_back({static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(entity)});
    }
  }
}

bool ExposureTiles::meets(const PlacedShadowMap& placed, float texel_m, const glm::ivec2& cell,
                          float plane_m) noexcept {
  const float own_m = texel_m * kOwnSide;
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

void ExposureTiles::shade(ExposureTile& tile, std::uint32_t index, float flux_frac,
                          const glm::vec4& gain, const EntityShadowMaps& shadow_maps) noexcept {
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
      const glm::ivec2 first = glm::max(floor_of(texel_of(box.low_m, -1.0F)), 0);
      const glm::ivec2 last = glm::min(floor_of(texel_of(box.high_m, 1.0F)), kLast);
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

void ExposureTiles::raise(ExposureTile& tile, int x, int y, float top_m) noexcept {
  // Raise the neighbours too, because shade is interpolated between texels.
  constexpr auto kLast = static_cast<int>(kSide) - 1;
  for (int row = std::max(0, y - 1); row <= std::min(kLast, y + 1); ++row) {
    for (int column = std::max(0, x - 1); column <= std::min(kLast, x + 1); ++column) {
      float& here_m =
          tile.top_m[static_cast<std::size_t>(row) * kSide + static_cast<std::size_t>(column)];
      here_m = std::max(here_m, top_m);
    }
  }
  tile.top_changed = true;
}

void ExposureTiles::take_turn(std::int64_t turn, std::int64_t turns, Pace pace,
                              const SurfaceSamples& all, const Inputs& inputs) noexcept {
  pace_ = pace;
  const std::int64_t end_ns = start_ns_ + turn * kTurnNs;
  const std::int64_t middle_ns = end_ns - turns * kTurnNs / 2;
  const physics::SunPosition sun = inputs.environment.sun_at(middle_ns);
  casts_.clear();
  float flux_frac = 0.0F;
  // List who casts on which tile. Entities that have moved come first, so that they get tiles.
  if (sun.direction_enu.z > kMinSunSine) {
    const physics::Forcing forcing = inputs.environment.forcing_at(middle_ns, sun);
    flux_frac = static_cast<float>(forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac) /
                                   ShadeResponse::kFullSunWM2);
    slope_ = glm::vec2(sun.direction_enu) / static_cast<float>(sun.direction_enu.z);
    for (const bool moved : {true, false}) {
      for (std::size_t m = 0; m < inputs.entities.size(); ++m) {
        if (has_moved(m, inputs.entities[m], end_ns) == moved) {
          cast(m, turn, turns, moved, sun.direction_enu, inputs);
        }
      }
    }
  }
  // Step one group of tiles in a step of normal length, so that frames share the work.
  const std::size_t stride = pace == Pace::one_group ? kTurns : 1;
  const std::size_t first = static_cast<std::size_t>(turn) % stride;
  inputs.workers.run(tiles_.size() / stride, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const std::size_t p = first + i * stride;
      ExposureTile& tile = tiles_[p];
      if (!tile.used) continue;
      const glm::vec4 left = left_after(turn - tile.at_turn);
      tile.at_turn = turn;
      if (tile.cast_turn > turn - turns) {
        shade(tile, static_cast<std::uint32_t>(p), flux_frac, 1.0F - left, inputs.shadow_maps);
      } else {
        tile.left_frac *= left;
      }
    }
  });
  // Give back tiles that hold next to nothing, and show the others at their vertices.
  for (std::size_t p = first; p < tiles_.size(); p += stride) {
    ExposureTile& tile = tiles_[p];
    if (!tile.used) continue;
    if (tile.cast_turn <= turn - turns && effect_k(tile) < kMinEffectFrac * tolerance_k_) {
      give_back(tile);
    } else {
      show_vertices(tile, all, end_ns);
    }
  }
}

glm::vec4 ExposureTiles::at(const ExposureTile& tile, const glm::vec3& position_m) const noexcept {
  // Follow the sun's ray from the place to the plane.
  const float height_m = position_m.z - tile.plane_m;
  const glm::vec2 at = (glm::vec2(position_m) - height_m * slope_ - tile.first_m) / tile.texel_m;
  constexpr float kLast = kSide - 1.001F;
  const glm::vec2 inside = glm::clamp(at, 0.0F, kLast);
  const glm::ivec2 first = floor_of(inside);
  const glm::vec2 way = inside - glm::vec2(first);
  const std::size_t i =
      static_cast<std::size_t>(first.y) * kSide + static_cast<std::size_t>(first.x);
  const std::size_t nearest = i + (way.x < 0.5F ? 0U : 1U) + (way.y < 0.5F ? 0U : kSide);
  if (height_m > tile.top_m[nearest]) return glm::vec4(0.0F);
  return glm::mix(glm::mix(tile.shade[i], tile.shade[i + 1], way.x),
                  glm::mix(tile.shade[i + kSide], tile.shade[i + kSide + 1], way.x), way.y);
}

void ExposureTiles::gather(ExposureTile& tile, const SurfaceSamples& all,
                           std::int64_t at_ns) const noexcept {
  tile.vertices_ns = at_ns;
  tile.vertices.clear();
  tile.fine = false;
  if (of_square_.empty()) return;
  const float own_m = tile.texel_m * kOwnSide;
  const glm::vec2 low_m = own_m * glm::vec2(tile.cell);
  const glm::vec2 high_m = low_m + own_m;
  // Find the squares from which the sun's rays lead into the tile.
  const glm::vec2 reach_m = std::max(tile.reach_m, -tile.lowest_m) * glm::abs(slope_);
  const auto square_at = [&](const glm::vec2& at_m) {
    return glm::clamp(floor_of((at_m - squares_m_) / square_m_), glm::ivec2(0), squares_ - 1);
  };
  const glm::ivec2 first = square_at(low_m - reach_m);
  const glm::ivec2 last = square_at(high_m + reach_m);
  for (int y = first.y; y <= last.y; ++y) {
    for (int x = first.x; x <= last.x; ++x) {
      const std::size_t square =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(squares_.x) +
          static_cast<std::size_t>(x);
      for (std::uint32_t k = first_of_square_[square]; k < first_of_square_[square + 1]; ++k) {
        const glm::vec3& position_m = all.samples[of_square_[k]].position_m;
        const float height_m = position_m.z - tile.plane_m;
        if (height_m > tile.reach_m || height_m < tile.lowest_m) continue;
        const glm::vec2 at_m = glm::vec2(position_m) - height_m * slope_;
        if (glm::any(glm::lessThan(at_m, low_m)) || glm::any(glm::greaterThanEqual(at_m, high_m))) {
          continue;
        }
        if (tile.vertices.size() == kMaxVertices) {
          tile.vertices.clear();
          tile.fine = true;
          return;
        }
        tile.vertices.push_back({of_square_[k], at(tile, position_m)});
      }
    }
  }
  // Sort them, because neighbours in memory go to the device in one range.
  std::ranges::sort(tile.vertices, {}, &Vertex::sample);
}

void ExposureTiles::hide_vertices(ExposureTile& tile) noexcept {
  for (const Vertex& vertex : tile.vertices) {
    vertices_k_[vertex.sample] -= vertex.shown_k;
    changes_.add(vertex.sample, 1);
  }
  tile.vertices.clear();
}

void ExposureTiles::show_vertices(ExposureTile& tile, const SurfaceSamples& all,
                                  std::int64_t now_ns) noexcept {
  // Gather the vertices again from time to time, because the sun moves on.
  if (tile.vertices_ns <= now_ns - kGatherNs) {
    hide_vertices(tile);
    gather(tile, all, now_ns);
  }
  // Correct each vertex whose value has changed by more than the device needs to know.
  for (Vertex& vertex : tile.vertices) {
    const SurfaceSample& sample = all.samples[vertex.sample];
    if (tile.changed) vertex.shade = at(tile, sample.position_m);
    const float shown_k =
        glm::dot(response_.weights_k()[sample.material], tile.left_frac * vertex.shade);
    if (std::abs(shown_k - vertex.shown_k) < kMinChangeK) continue;
    vertices_k_[vertex.sample] += shown_k - vertex.shown_k;
    vertex.shown_k = shown_k;
    changes_.add(vertex.sample, 1);
  }
}

}  // namespace emit::renderer
