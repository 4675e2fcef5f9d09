// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <span>

#include "history/pose_history.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/shade/entity_casts.hpp"
#include "surface/shade/exposure_step.hpp"
#include "surface/shade/exposure_tile.hpp"
#include "surface/shade/exposure_tile_pool.hpp"
#include "surface/shade/shade_response.hpp"
#include "surface/shade/tile_vertices.hpp"

namespace emit::renderer {

/// Exposure tiles: squares of level ground that remember how long entities have shaded static
/// surfaces. Their texels are centimetres wide, because triangles there are as large as the warm-up
/// left them: nobody knew where an entity would go. A tile is taken where shade falls and given
/// back when almost nothing of the shade is left. A texel holds A_k for each mode k of
/// ShadeResponse: the mean of shaded share times direct sun with the weight exp(-age / tau_k)
/// (physics.md eq. 25). Entities have changed the temperature at a place by -sum w_k A_k times the
/// cosine to the sun times the share of the sun's disc that static geometry leaves.
///
/// Frames add this change per pixel and take it off again per vertex, because the samples hold the
/// whole change already. The sum has the temperatures of the samples and the edges of the tiles. An
/// error of the response shows only as a difference between a pixel and its vertices.
///
/// This class owns the time of the tiles: it divides sim time into steps and says which tiles take
/// part. Its parts are the memory of the tiles (ExposureTilePool), the entities that shade them
/// (EntityCasts) and the lookup of shade by vertex (TileVertices).
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe.
class ExposureTiles {
 public:
  using ExposureTile = renderer::ExposureTile;
  using Inputs = ExposureInputs;
  static constexpr std::size_t kTiles = ExposureTilePool::kTiles;
  static constexpr std::uint32_t kSide = ExposureTile::kSide;
  static constexpr std::int64_t kStepNs = ExposureStep::kStepNs;
  static constexpr std::int64_t kTurns = ExposureStep::kTurns;
  static constexpr std::int64_t kTurnNs = ExposureStep::kTurnNs;
  static constexpr std::int64_t kShortTurns = 10'000'000'000 / kTurnNs;
  /// Longest time, in turns, that run() covers in steps of normal length. For a longer time it
  /// steps all tiles at once, in at most kMaxWindows windows of at most kMaxWindowTurns. After a
  /// jump of sim time only the latest part, of that length in all, is made up for.
  static constexpr std::int64_t kTurnsPerFrame = 3 * kTurns;
  static constexpr std::int64_t kMaxWindowTurns = 15'000'000'000 / kTurnNs;
  static constexpr std::int64_t kMaxWindows = 4;

  /// Takes memory for all tiles where there are entities. `drawn` is the number of samples that are
  /// vertices. `start_ns` is a node of the grid on which steps begin. `tolerance_k` is
  /// thermal.tolerance_k.
  ExposureTiles(const SurfaceSamples& all, std::uint32_t drawn, ShadeResponse response,
                std::size_t entities, std::int64_t start_ns, float tolerance_k);

  /// Forgets all shade and begins at `now_ns`. The samples already know the shade that the entities
  /// cast from where they stand at that time.
  void restart(std::int64_t now_ns, std::span<const PoseHistory> entities) noexcept;
  /// Does the steps up to `until_ns`. If `until_ns` lies before the latest step, all shade is
  /// forgotten.
  void run(std::int64_t until_ns, const SurfaceSamples& all, const Inputs& inputs) noexcept;

  [[nodiscard]] std::span<const ExposureTile> tiles() const noexcept { return pool_.tiles(); }
  [[nodiscard]] const ShadeResponse& response() const noexcept { return response_; }
  /// Sum w_k A_k by vertex, in K.
  [[nodiscard]] std::span<const float> vertices_k() const noexcept { return vertices_.sums_k(); }
  [[nodiscard]] std::span<const ChangedRanges::Range> changes() const noexcept {
    return vertices_.changes();
  }
  void forget_changes() noexcept;
  /// Horizontal shift of a shadow towards the sun per metre of height, in the latest step.
  [[nodiscard]] const glm::vec2& slope() const noexcept { return slope_; }
  /// Returns true if shade was lost in the latest ten seconds or in the latest run(): it found no
  /// tile, it took a tile that held more than the tolerance, or an entity was too fast. Only
  /// entities that have moved since restart() count. It returns true as well after sim time went
  /// back.
  [[nodiscard]] bool short_of_tiles() const noexcept {
    return short_turn_ > next_turn_ - kShortTurns || short_turn_ >= first_turn_;
  }

 private:
  /// Steps tiles to the end of `turn`. The shade is that of the latest `turns` turns.
  void take_turn(std::int64_t turn, std::int64_t turns, ExposureStep::Pace pace,
                 const SurfaceSamples& all, const Inputs& inputs) noexcept;

  ShadeResponse response_;
  std::int64_t start_ns_ = 0;
  std::int64_t next_turn_ = 0;   ///< the turn that ends at start_ns_ + next_turn_ * kTurnNs
  std::int64_t first_turn_ = 0;  ///< first turn of the latest run()
  std::int64_t short_turn_ = 0;  ///< latest turn in which shade was lost
  glm::vec2 slope_{0.0F};
  ExposureTilePool pool_;
  EntityCasts casts_;
  TileVertices vertices_;
};

}  // namespace emit::renderer
