// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/exposure_tiles.hpp"

#include <algorithm>
#include <utility>

#include "history/cloud_shade.hpp"

namespace emit::renderer {
namespace {

/// Sine of the lowest sun that tiles are made for. A lower sun draws shadows too long for them and
/// hardly warms level ground.
constexpr double kMinSunSine = 0.05;

/// The middle of a tile.
glm::vec3 middle_of(const ExposureTile& tile) noexcept {
  const float half_m = 0.5F * static_cast<float>(ExposureTile::kSide - 1) * tile.texel_m;
  return {tile.first_m + half_m, tile.plane_m};
}

/// Share of older shade that is left after `turns` turns, by mode.
glm::vec4 left_after(std::int64_t turns) noexcept {
  return ShadeResponse::left_frac(1e-9 * static_cast<double>(turns * ExposureStep::kTurnNs));
}

}  // namespace

ExposureTiles::ExposureTiles(const SurfaceSamples& all, std::uint32_t drawn, ShadeResponse response,
                             std::size_t entities, std::int64_t start_ns, float tolerance_k)
    : response_(std::move(response)),
      start_ns_(start_ns),
      pool_(entities, ShadeEffect(response_, tolerance_k)),
      casts_(entities, ShadeEffect(response_, tolerance_k)),
      vertices_(all, entities > 0 ? drawn : 0) {}

void ExposureTiles::restart(std::int64_t now_ns, std::span<const PoseHistory> entities) noexcept {
  casts_.restart(now_ns, entities);
  for (ExposureTile& tile : pool_.tiles()) {
    if (tile.used) pool_.give_back(tile, vertices_);
  }
  next_turn_ = std::max<std::int64_t>(0, now_ns - start_ns_) / kTurnNs + 1;
  first_turn_ = next_turn_;
  short_turn_ = next_turn_ - kShortTurns;
}

void ExposureTiles::forget_changes() noexcept {
  vertices_.forget_changes();
  for (ExposureTile& tile : pool_.tiles()) tile.changed = tile.top_changed = false;
}

void ExposureTiles::run(std::int64_t until_ns, const SurfaceSamples& all,
                        const Inputs& inputs) noexcept {
  if (pool_.tiles().empty()) return;
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
      take_turn(next_turn_, kTurns, ExposureStep::Pace::one_group, all, inputs);
    }
    return;
  }
  // After a long jump, let what the tiles hold fade over the part that is left out.
  if (end - next_turn_ > kMaxWindows * kMaxWindowTurns) {
    next_turn_ = end - kMaxWindows * kMaxWindowTurns;
    for (ExposureTile& tile : pool_.tiles()) {
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
    take_turn(next_turn_ - 1, turns, ExposureStep::Pace::all, all, inputs);
  }
}

void ExposureTiles::take_turn(std::int64_t turn, std::int64_t turns, ExposureStep::Pace pace,
                              const SurfaceSamples& all, const Inputs& inputs) noexcept {
  const ExposureStep step{turn, turns, pace, start_ns_ + turn * kTurnNs};
  const physics::SunPosition sun = inputs.environment.sun_at(step.middle_ns());
  casts_.clear();
  float flux_frac = 0.0F;
  CloudShade clouds;
  // List which entity casts on which tile.
  if (sun.direction_enu.z > kMinSunSine) {
    const physics::Forcing forcing = inputs.environment.forcing_at(step.middle_ns(), sun);
    flux_frac = static_cast<float>(forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac) /
                                   ShadeResponse::kFullSunWM2);
    // Under a cloud there is less sun for an entity to keep off.
    clouds.update(step.begin_ns(), step.end_ns, inputs.environment, inputs.origin_world_m);
    slope_ = glm::vec2(sun.direction_enu) / static_cast<float>(sun.direction_enu.z);
    if (casts_.list(step, sun.direction_enu, inputs, pool_, vertices_)) short_turn_ = turn;
  }
  // Step the tiles. A step of normal length has one group of them, so that frames share the work.
  const std::span<ExposureTile> tiles = pool_.tiles();
  const std::size_t stride = step.stride();
  const std::size_t first = step.first_tile();
  inputs.workers.run(tiles.size() / stride, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const std::size_t p = first + i * stride;
      ExposureTile& tile = tiles[p];
      if (!tile.used) continue;
      const glm::vec4 left = left_after(turn - tile.at_turn);
      tile.at_turn = turn;
      if (step.covers(tile.cast_turn)) {
        const float cloud_sun = clouds.any() ? clouds.by_mean(middle_of(tile)) : 1.0F;
        casts_.shade(tile, p, cloud_sun * flux_frac, 1.0F - left, inputs.shadow_maps);
      } else {
        tile.left_frac *= left;
      }
    }
  });
  // Give back tiles that hold next to nothing, and show the others at their vertices.
  for (std::size_t p = first; p < tiles.size(); p += stride) {
    ExposureTile& tile = tiles[p];
    if (!tile.used) continue;
    if (!step.covers(tile.cast_turn) && pool_.holds_little(tile)) {
      pool_.give_back(tile, vertices_);
    } else {
      vertices_.show(tile, all, response_, slope_, step.end_ns);
    }
  }
}

}  // namespace emit::renderer
