// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float4.hpp>
#include <glm/ext/vector_int2.hpp>
#include <vector>

#include "shared/shade_params.glsl.h"

namespace emit::renderer {

/// One exposure tile: a square of level ground whose texels remember how long entities have shaded
/// it. A texel holds A_k for each mode k of ShadeResponse. Coordinates are rel, in metres.
///
/// Owner: ExposureTilePool. The parts of ExposureTiles write it; the device copies it.
struct ExposureTile {
  static constexpr std::uint32_t kSide = EMIT_EXPOSURE_TILE_SIDE;
  /// Texels along a side that belong to the tile itself. The outermost texels repeat those of its
  /// neighbours.
  static constexpr std::uint32_t kOwnSide = kSide - 2;
  /// Largest number of vertices of a tile. Triangles of a tile with more vertices are fine enough
  /// without it.
  static constexpr std::size_t kMaxVertices = 4096;
  /// Margin above and below the heights that a tile covers, in m.
  static constexpr float kReachMarginM = 0.5F;

  /// A static vertex whose shade a tile holds.
  struct Vertex {
    std::uint32_t sample = 0;
    glm::vec4 shade{0.0F};  ///< A_k of the texels around the vertex, by mode
    float shown_k = 0.0F;   ///< this tile's part of TileVertices::sums_k()
  };

  bool used = false;
  bool changed = false;      ///< texels have changed since ExposureTiles::forget_changes()
  bool top_changed = false;  ///< top_m has changed since ExposureTiles::forget_changes()
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

}  // namespace emit::renderer
