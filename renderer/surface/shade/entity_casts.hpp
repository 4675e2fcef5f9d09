// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "history/pose_history.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/shade/entity_shadow_maps.hpp"
#include "surface/shade/exposure_step.hpp"
#include "surface/shade/exposure_tile.hpp"
#include "surface/shade/exposure_tile_pool.hpp"
#include "surface/shade/shade_response.hpp"
#include "surface/shade/tile_vertices.hpp"

namespace emit::renderer {

/// The entities that shade exposure tiles in a step, and the rendering of their shade into a tile.
/// It owns the list of pairs of a tile and an entity, the places of entities along their way in the
/// step, and the poses from which it is seen that an entity has moved.
///
/// Owner: ExposureTiles. Thread: the renderer's; shade() may run on all cores, one tile each. Real
/// time: everything but the constructor is RT-safe.
class EntityCasts {
 public:
  EntityCasts(std::size_t entities, const ShadeEffect& effect);

  /// Takes the poses at `now_ns` as those of entities that have not moved.
  void restart(std::int64_t now_ns, std::span<const PoseHistory> entities) noexcept;
  /// Forgets which entity casts on which tile.
  void clear() noexcept { casts_.clear(); }
  /// Lists which entity casts on which tile in a step, after clear(), and takes new tiles. Entities
  /// that have moved come first, so that they get tiles. `to_sun` is the unit vector to the sun in
  /// the middle of the step. Returns true if shade of a moved entity was lost.
  [[nodiscard]] bool list(const ExposureStep& step, const glm::dvec3& to_sun,
                          const ExposureInputs& inputs, ExposureTilePool& pool,
                          TileVertices& vertices) noexcept;
  /// Advances the texels of a tile by one step: `index` is that of the tile in its pool,
  /// `flux_frac` is the direct sun as a share of ShadeResponse::kFullSunWM2, and `gain` is 1 -
  /// exp(-dt / tau_k).
  void shade(ExposureTile& tile, std::size_t index, float flux_frac, const glm::vec4& gain,
             const EntityShadowMaps& shadow_maps) const noexcept;

 private:
  /// Pair of a tile and an entity that casts on it.
  struct Cast {
    std::uint32_t tile = 0;
    std::uint32_t entity = 0;
  };
  /// Shadow depth map of an entity at one of its places within a step. The places share the taps:
  /// place `number` of `of` takes every `of`th tap.
  struct Place {
    PlacedShadowMap shadow_map;
    std::uint32_t number = 0;
    std::uint32_t of = 1;
  };
  /// An entity at one of its places, with what is needed to find the tiles that it shades.
  struct Caster {
    std::size_t entity = 0;
    bool moved = false;  ///< it has moved since restart(): only its shade may take used tiles
    const PlacedShadowMap& placed;
    float ground_m = 0.0F;  ///< height of the ground behind it, rel
    float top_m = 0.0F;     ///< height of its top, rel
  };
  /// Largest number of places of an entity within a step. It divides EMIT_SHADE_TAPS, so that
  /// places get equal shares of the taps.
  static constexpr std::size_t kMaxPlaces = 8;
  static_assert(EMIT_SHADE_TAPS % kMaxPlaces == 0);
  static constexpr std::size_t kMaxCasts = 96;  ///< tiles per entity in a step, on average

  /// Returns true if the entity stands elsewhere than at restart(), or has appeared or vanished.
  [[nodiscard]] bool has_moved(std::size_t entity, const PoseHistory& poses,
                               std::int64_t at_ns) const noexcept;
  /// Places an entity along its way in a step and lists the tiles that it shades. Returns true if
  /// shade was lost.
  [[nodiscard]] bool cast(std::size_t entity, bool moved, const ExposureStep& step,
                          const glm::dvec3& to_sun, const ExposureInputs& inputs,
                          ExposureTilePool& pool, TileVertices& vertices) noexcept;
  /// Lists the tiles on which an entity casts from one place, and takes new ones. Returns true if
  /// shade was lost.
  [[nodiscard]] bool find_tiles(const Caster& caster, const ExposureStep& step,
                                const ExposureInputs& inputs, ExposureTilePool& pool,
                                TileVertices& vertices) noexcept;

  ShadeEffect effect_;
  std::vector<Cast> casts_;                        ///< its capacity is its largest size
  std::bitset<ExposureTilePool::kTiles> cast_on_;  ///< tiles on which the entity at hand casts
  std::vector<Place> places_;                      ///< by entity, then place
  std::vector<std::uint32_t> place_count_;         ///< by entity
  std::vector<TrajectoryState> at_start_;          ///< by entity
};

}  // namespace emit::renderer
