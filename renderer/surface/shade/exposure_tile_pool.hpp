// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_int2.hpp>
#include <optional>
#include <span>
#include <vector>

#include "surface/rays/caster_rays.hpp"
#include "surface/shade/exposure_step.hpp"
#include "surface/shade/exposure_tile.hpp"
#include "surface/shade/shade_response.hpp"
#include "surface/shade/tile_vertices.hpp"

namespace emit::renderer {

/// Memory and keys of all exposure tiles. It owns the tiles, finds them by their place on the
/// ground, and decides which tile is taken where there is none. A tile keeps its index, because the
/// index names its group (ExposureStep).
///
/// Owner: ExposureTiles. Thread: the renderer's. Real time: everything but the constructor is
/// RT-safe.
class ExposureTilePool {
 public:
  static constexpr std::size_t kTiles = 128;

  /// Level and cell of a tile.
  struct Key {
    int level = kNoLevel;
    glm::ivec2 cell{0};
    [[nodiscard]] bool operator==(const Key&) const noexcept = default;
  };
  /// Answer of take().
  struct Taken {
    ExposureTile* tile = nullptr;  ///< null if no tile was taken
    bool lost = false;             ///< shade that matters was lost
  };

  /// Takes memory for kTiles tiles where there are entities, and for none elsewhere.
  ExposureTilePool(std::size_t entities, const ShadeEffect& effect);

  [[nodiscard]] std::span<ExposureTile> tiles() noexcept { return tiles_; }
  [[nodiscard]] std::span<const ExposureTile> tiles() const noexcept { return tiles_; }
  /// Index of a tile of this pool.
  [[nodiscard]] std::size_t index_of(const ExposureTile& tile) const noexcept {
    return static_cast<std::size_t>(&tile - tiles_.data());
  }
  /// Returns the tile with this key, or null if there is none.
  [[nodiscard]] ExposureTile* find(const Key& key) noexcept;
  /// Begins an empty tile with this key. It is an unused one. If there is none, an entity that has
  /// `moved` gets the tile that holds least, which is given back first. No tile is taken if no
  /// static surface lies below `top_m`, which is the height of the entity's top, rel.
  [[nodiscard]] Taken take(const Key& key, float top_m, const ExposureStep& step, bool moved,
                           const CasterRays& rays, TileVertices& vertices) noexcept;
  /// Takes the tile's shade from its vertices and leaves the tile unused.
  void give_back(ExposureTile& tile, TileVertices& vertices) noexcept;
  /// Returns true if a tile holds so little that it may be given back.
  [[nodiscard]] bool holds_little(const ExposureTile& tile) const noexcept;

 private:
  static constexpr int kNoLevel = 1000;

  /// Returns an unused tile, or the one to give back for an entity that has `moved`.
  [[nodiscard]] Taken choose(std::int64_t turn, bool moved) noexcept;
  /// Height of the plane of a new tile, from five rays down. It is that of a neighbour if the two
  /// are close to each other. It is empty if the rays meet nothing.
  [[nodiscard]] std::optional<float> plane_of(const Key& key, float top_m,
                                              const CasterRays& rays) const noexcept;
  /// Upper bound, in K, of the change of temperature that a tile holds.
  [[nodiscard]] float effect_k(const ExposureTile& tile) const noexcept;

  ShadeEffect effect_;
  std::vector<ExposureTile> tiles_;
  /// The keys of all tiles lie side by side, because they are searched often.
  std::array<Key, kTiles> keys_;
};

}  // namespace emit::renderer
