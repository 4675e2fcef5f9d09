// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float4.hpp>
#include <glm/ext/vector_int2.hpp>
#include <glm/ext/vector_uint2.hpp>
#include <optional>
#include <span>
#include <vector>

#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/heat/surface_node.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/shade/entity_shadow_maps.hpp"
#include "surface/shade/shade_response.hpp"

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
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe.
class ExposureTiles {
 public:
  static constexpr std::size_t kTiles = 128;
  static constexpr std::uint32_t kSide = EMIT_EXPOSURE_TILE_SIDE;
  /// Texels along a side that belong to the tile itself. The outermost texels repeat those of its
  /// neighbours.
  static constexpr std::uint32_t kOwnSide = kSide - 2;
  /// Normal time step of a tile, in ns. In each turn of kTurnNs one of kTurns groups of tiles does
  /// its step.
  static constexpr std::int64_t kStepNs = 200'000'000;
  static constexpr std::int64_t kTurns = 8;
  static constexpr std::int64_t kTurnNs = kStepNs / kTurns;
  static constexpr std::int64_t kShortTurns = 10'000'000'000 / kTurnNs;
  /// Longest time, in turns, that run() covers in steps of normal length. For a longer time it
  /// steps all tiles at once, in at most kMaxWindows windows of at most kMaxWindowTurns. After a
  /// jump of sim time only the latest part, of that length in all, is made up for.
  static constexpr std::int64_t kTurnsPerFrame = 3 * kTurns;
  static constexpr std::int64_t kMaxWindowTurns = 15'000'000'000 / kTurnNs;
  static constexpr std::int64_t kMaxWindows = 4;
  /// Largest number of vertices of a tile. Triangles of a tile with more vertices are fine enough
  /// without it.
  static constexpr std::size_t kMaxVertices = 4096;

  /// A static vertex whose shade a tile holds.
  struct Vertex {
    std::uint32_t sample = 0;
    glm::vec4 shade{0.0F};  ///< A_k of the texels around the vertex, by mode
    float shown_k = 0.0F;   ///< this tile's part of vertices_k()
  };
  /// One exposure tile. Coordinates are rel, in metres.
  struct ExposureTile {
    bool used = false;
    bool changed = false;      ///< texels have changed since forget_changes()
    bool top_changed = false;  ///< top_m has changed since forget_changes()
    bool fine = false;         ///< it has more vertices than kMaxVertices and is not shown
    int level = 0;             ///< texels are 2^level m wide
    glm::ivec2 cell{0};  ///< place in the grid of own squares of that level, from the origin of rel
    float texel_m = 1.0F;
    glm::vec2 first_m{0.0F};    ///< centre of the first texel
    float plane_m = 0.0F;       ///< height of the tile's plane
    float reach_m = 0.0F;       ///< points higher above the plane are not shaded
    float lowest_m = 0.0F;      ///< points lower than this above the plane are not shaded; negative
    glm::vec4 left_frac{1.0F};  ///< by mode: factor of what texels and vertices hold
    std::vector<glm::vec4> shade;  ///< kSide rows of kSide texels
    std::vector<float> target;     ///< scratch of a step: shaded share, by texel
    /// Height above the plane, in m, above which nothing was shaded along the sun's ray through a
    /// texel, by texel.
    std::vector<float> top_m;
    std::array<std::uint8_t, kSide> marked{};  ///< by row: 1 where a texel may differ from 0
    std::vector<Vertex> vertices;
    glm::vec4 most{0.0F};          ///< largest value of the texels, by mode
    std::int64_t vertices_ns = 0;  ///< time at which vertices were gathered
    std::int64_t at_turn = 0;      ///< turn up to which the tile has stepped
    std::int64_t cast_turn = 0;    ///< latest turn in which an entity cast on it
    std::int64_t moved_turn = 0;   ///< latest turn in which a moved entity cast on it
  };
  /// Data that a step reads, and the entity shadow depth maps that it makes anew where needed.
  struct Inputs {
    const Environment& environment;
    std::span<const PoseHistory> entities;
    const CasterRays& rays;
    threads::WorkerPool& workers;
    EntityShadowMaps& shadow_maps;
  };

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

  [[nodiscard]] std::span<const ExposureTile> tiles() const noexcept { return tiles_; }
  [[nodiscard]] const ShadeResponse& response() const noexcept { return response_; }
  /// Sum w_k A_k by vertex, in K.
  [[nodiscard]] std::span<const float> vertices_k() const noexcept { return vertices_k_; }
  [[nodiscard]] std::span<const ChangedRanges::Range> changes() const noexcept {
    return changes_.ranges();
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
  /// Pair of a tile and an entity that casts on it.
  struct Cast {
    std::uint32_t tile = 0;
    std::uint32_t entity = 0;
    [[nodiscard]] bool operator==(const Cast&) const noexcept = default;
  };
  /// Shadow depth map of an entity at one of its places within a step. The places share the taps:
  /// place `number` of `of` takes every `of`th tap.
  struct Place {
    PlacedShadowMap shadow_map;
    std::uint32_t number = 0;
    std::uint32_t of = 1;
  };
  /// Largest number of places of an entity within a step. It divides EMIT_SHADE_TAPS, so that
  /// places get equal shares of the taps.
  static constexpr std::size_t kMaxPlaces = 8;
  static constexpr std::size_t kMaxCells = 24;  ///< tiles that an entity may shade from one place
  static constexpr std::size_t kMaxCasts = 96;  ///< tiles per entity in a step, on average

  /// Which tiles a call of take_turn() steps.
  enum class Pace : std::uint8_t {
    one_group,  ///< the group whose turn it is: steps of normal length
    all,        ///< every tile: windows that make up for a longer time
  };

  /// Steps tiles to the end of `turn`. The shade is that of the latest `turns` turns.
  void take_turn(std::int64_t turn, std::int64_t turns, Pace pace, const SurfaceSamples& all,
                 const Inputs& inputs) noexcept;
  /// Places an entity along its way in the latest `turns` turns and lists the tiles that it shades.
  /// `moved` says that the entity has moved since restart(): only such shade may take used tiles.
  void cast(std::size_t entity, std::int64_t turn, std::int64_t turns, bool moved,
            const glm::dvec3& to_sun, const Inputs& inputs) noexcept;
  /// Lists the tiles on which an entity casts from one place, and takes new ones. `ground_m` is the
  /// height of the ground behind the entity, and `top_m` is the height of its top, both rel.
  void find_tiles(std::size_t entity, std::int64_t turn, std::int64_t turns, bool moved,
                  const PlacedShadowMap& placed, float ground_m, float top_m,
                  const Inputs& inputs) noexcept;
  /// Returns true if the shadow of an entity, penumbra included, may touch the cell of a tile.
  [[nodiscard]] static bool meets(const PlacedShadowMap& placed, float texel_m,
                                  const glm::ivec2& cell, float plane_m) noexcept;
  [[nodiscard]] ExposureTile* tile_at(int level, const glm::ivec2& cell) noexcept;
  /// Height of the plane of a new tile, from five rays down. It is that of a neighbour if the two
  /// are close to each other. It is empty if the rays meet nothing.
  [[nodiscard]] std::optional<float> plane_of(int level, const glm::ivec2& cell, float top_m,
                                              const CasterRays& rays) const noexcept;
  /// Returns an unused tile. If there is none, an entity that has `moved` gets the tile that holds
  /// least. Returns null if no tile can be taken.
  [[nodiscard]] ExposureTile* take_tile(std::int64_t turn, bool moved) noexcept;
  /// Returns true if the entity stands elsewhere than at restart(), or has appeared or vanished.
  [[nodiscard]] bool has_moved(std::size_t entity, const PoseHistory& poses,
                               std::int64_t at_ns) const noexcept;
  void give_back(ExposureTile& tile) noexcept;
  [[nodiscard]] bool begin(ExposureTile& tile, int level, const glm::ivec2& cell, float top_m,
                           const CasterRays& rays) const noexcept;
  /// Finds the vertices whose shade falls into a tile.
  void gather(ExposureTile& tile, const SurfaceSamples& all, std::int64_t at_ns) const noexcept;
  /// Advances the texels of a tile by one step: `flux_frac` is the direct sun as a share of
  /// ShadeResponse::kFullSunWM2, and `gain` is 1 - exp(-dt / tau_k).
  void shade(ExposureTile& tile, std::uint32_t index, float flux_frac, const glm::vec4& gain,
             const EntityShadowMaps& shadow_maps) noexcept;
  /// Records that points at a texel and at its neighbours are shaded up to a height above the
  /// plane.
  static void raise(ExposureTile& tile, int x, int y, float top_m) noexcept;
  /// Brings the tile's part of vertices_k() up to date.
  void show_vertices(ExposureTile& tile, const SurfaceSamples& all, std::int64_t now_ns) noexcept;
  /// Takes the tile's part out of vertices_k() and forgets its vertices.
  void hide_vertices(ExposureTile& tile) noexcept;
  /// A_k at a place, interpolated between texels along the sun's ray; 0 above the shaded height.
  [[nodiscard]] glm::vec4 at(const ExposureTile& tile, const glm::vec3& position_m) const noexcept;
  /// Greatest change of temperature, in K, that full shade of this duration causes.
  [[nodiscard]] float passing_k(float seconds) const noexcept;
  /// Upper bound, in K, of the change of temperature that a tile holds.
  [[nodiscard]] float effect_k(const ExposureTile& tile) const noexcept;

  ShadeResponse response_;
  glm::vec4 most_weight_k_{0.0F};
  float tolerance_k_ = 0.0F;
  std::int64_t start_ns_ = 0;
  std::int64_t next_turn_ = 0;   ///< the turn that ends at start_ns_ + next_turn_ * kTurnNs
  std::int64_t first_turn_ = 0;  ///< first turn of the latest run()
  std::vector<ExposureTile> tiles_;
  /// Level and cell of a tile. The keys of all tiles lie side by side, because they are searched
  /// often.
  struct Key {
    int level = kNoLevel;
    glm::ivec2 cell{0};
  };
  static constexpr int kNoLevel = 1000;
  std::array<Key, kTiles> keys_;
  std::vector<Cast> casts_;
  std::bitset<kTiles> cast_on_;             ///< tiles on which the entity at hand casts already
  std::vector<Place> places_;               ///< by entity, then place
  std::vector<std::uint32_t> place_count_;  ///< by entity
  std::vector<TrajectoryState> at_start_;   ///< by entity
  glm::vec2 slope_{0.0F};
  std::vector<float> vertices_k_;
  ChangedRanges changes_;
  std::int64_t short_turn_ = 0;  ///< latest turn in which shade was lost
  Pace pace_ = Pace::one_group;  ///< that of the turn at hand

  // Static vertices, sorted into squares of the ground, and the range of their heights.
  float highest_m_ = 0.0F;
  float lowest_m_ = 0.0F;
  glm::vec2 squares_m_{0.0F};
  float square_m_ = 1.0F;
  glm::ivec2 squares_{0};
  std::vector<std::uint32_t> first_of_square_;
  std::vector<std::uint32_t> of_square_;
};

}  // namespace emit::renderer
