// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>

#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/shade/entity_shadow_maps.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Data that a step of exposure tiles reads, and the entity shadow depth maps that it makes anew
/// where needed.
struct ExposureInputs {
  const Environment& environment;
  std::span<const PoseHistory> entities;
  const CasterRays& rays;
  threads::WorkerPool& workers;
  EntityShadowMaps& shadow_maps;
  glm::dvec3 origin_world_m{0.0};  ///< of rel
};

/// One step of exposure tiles: the stretch of sim time that it covers and the tiles that take part.
/// Sim time is counted in turns of kTurnNs, and a stretch of time ends with a turn. Tiles are in
/// kTurns groups, by their index in ExposureTilePool.
struct ExposureStep {
  /// Normal time step of a tile, in ns. In each turn of kTurnNs one of kTurns groups of tiles does
  /// its step.
  static constexpr std::int64_t kStepNs = 200'000'000;
  static constexpr std::int64_t kTurns = 8;
  static constexpr std::int64_t kTurnNs = kStepNs / kTurns;

  /// Tiles that take part.
  enum class Pace : std::uint8_t {
    one_group,  ///< the group whose turn it is: steps of normal length
    all,        ///< every tile: windows that make up for a longer time
  };

  std::int64_t turn = 0;        ///< last turn of the step
  std::int64_t turns = kTurns;  ///< number of turns that it covers
  Pace pace = Pace::one_group;
  std::int64_t end_ns = 0;  ///< end of the last turn

  [[nodiscard]] std::int64_t begin_ns() const noexcept { return end_ns - turns * kTurnNs; }
  [[nodiscard]] std::int64_t middle_ns() const noexcept { return end_ns - turns * kTurnNs / 2; }
  /// Returns true if the step covers a turn. It covers no turn before its beginning.
  /// @pre at_turn <= turn
  [[nodiscard]] bool covers(std::int64_t at_turn) const noexcept { return at_turn > turn - turns; }
  /// Index of the first tile that takes part, and the distance to the next one.
  [[nodiscard]] std::size_t first_tile() const noexcept {
    return static_cast<std::size_t>(turn) % stride();
  }
  [[nodiscard]] std::size_t stride() const noexcept { return pace == Pace::one_group ? kTurns : 1; }
  /// Turn up to which a tile counts as stepped if it is taken in this step. It lies so far back
  /// that the tile's first step is as long as every other one.
  [[nodiscard]] std::int64_t turn_before(std::size_t tile) const noexcept {
    const std::int64_t group = static_cast<std::int64_t>(tile) % kTurns;
    const std::int64_t wait =
        pace == Pace::one_group ? (group - turn % kTurns + kTurns) % kTurns : 0;
    return turn + wait - turns;
  }
};

}  // namespace emit::renderer
