// SPDX-License-Identifier: Apache-2.0
// Structs and constants of the shade of entities per pixel, for C++ and GLSL.
// An exposure tile is a level square of ground whose texels remember how long entities have shaded them.
// An entity shadow depth map holds the depths of one entity along the direction of the sun.
#pragma once
#include "shared/bindings.glsl.h"
#include "shared/cpp_glsl.glsl.h"

// Number of positions in the unit disc at which an entity shadow depth map is read.
#define EMIT_SHADE_TAPS 16
// A receiver counts as shaded where it lies this much deeper than the caster.
#define EMIT_SHADE_LIFT_M 0.01f
// Texels along a side of an exposure tile. The outermost texels repeat those of the neighbouring tiles.
#define EMIT_EXPOSURE_TILE_SIDE 128
#define EMIT_EXPOSURE_TILE_TEXELS 3
#define EMIT_ENTITY_SHADOW_TEXELS 4

EMIT_SHARED_BEGIN

// Uniform block that all exposure tiles and shadow depth maps of a frame share.
struct ShadeParams {
  vec2 slope;                      // shift of a shadow towards the sun per metre of height: east, north
  vec2 unused0;
  vec4 taps[EMIT_SHADE_TAPS / 2];  // positions in the unit disc, two in each entry
};

// One exposure tile in relworld axes. Shaders read it as EMIT_EXPOSURE_TILE_TEXELS texels.
struct ExposureTileParams {
  float first_x_m;     // centre of the first texel
  float first_y_m;
  float plane_m;       // height of the tile's plane
  float texels_per_m;
  float reach_m;       // a point higher above the plane than this is not shaded by the tile
  float lowest_m;      // a point lower than this above the plane is not shaded either; negative
  float layer;         // layer of the texture array
  float unused0;
  vec4 left_frac;      // by mode: share of the stored value that is left at the time of the frame
};

// One entity shadow depth map at the pose of the frame, in relworld axes. Shaders read it as EMIT_ENTITY_SHADOW_TEXELS
// texels. The dot product of a line with vec4(p, 1) gives the coordinate of the point p.
struct EntityShadowParams {
  vec4 column;                   // texels from the first column
  vec4 row;                      // texels from the first row
  vec4 depth_m;
  float mean_depth_m;            // mean depth of the caster
  float penumbra_texels_per_m;   // radius of the sun's disc on the map per metre of depth behind the caster
  float layer;                   // layer of the texture array
  float unused0;
};

// Square part of the rendered image, with the exposure tiles and shadow depth maps that may shade its pixels.
struct ShadeTile {
  uint place_px;        // first column + 65536 * first row
  uint first;           // index of its first entry in the list; exposure tiles come before shadow depth maps
  uint exposure_tiles;  // number of exposure tiles
  uint shadow_maps;     // number of shadow depth maps
};

#ifdef __cplusplus
static_assert(sizeof(ShadeParams) == 16 + 8 * EMIT_SHADE_TAPS);
EMIT_SHARED_OFFSET(ShadeParams, taps, 16);
static_assert(sizeof(ExposureTileParams) == 16 * EMIT_EXPOSURE_TILE_TEXELS);
EMIT_SHARED_OFFSET(ExposureTileParams, reach_m, 16);
EMIT_SHARED_OFFSET(ExposureTileParams, left_frac, 32);
static_assert(sizeof(EntityShadowParams) == 16 * EMIT_ENTITY_SHADOW_TEXELS);
EMIT_SHARED_OFFSET(EntityShadowParams, mean_depth_m, 48);
static_assert(sizeof(ShadeTile) == 16);
#endif

EMIT_SHARED_END

#ifdef __cplusplus
#include <cmath>
#include <cstdint>
#include <utility>
namespace emit::renderer {
/// Position of tap `index` in the unit disc (x, y), 0 <= index < EMIT_SHADE_TAPS. All taps stand for
/// equal areas; consecutive taps are a golden angle apart.
[[nodiscard]] inline std::pair<float, float> shade_tap(std::uint32_t index) noexcept {
  const float radius = std::sqrt((static_cast<float>(index) + 0.5F) / EMIT_SHADE_TAPS);
  const float angle = 2.39996323F * static_cast<float>(index);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}
}  // namespace emit::renderer
#endif
