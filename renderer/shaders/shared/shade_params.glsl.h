// SPDX-License-Identifier: Apache-2.0
// Shade of entities, finer than samples lie: what C++ and GLSL must do alike.
#pragma once
#include "shared/bindings.glsl.h"
#include "shared/cpp_glsl.glsl.h"

// Places in the unit disc at which a silhouette is looked at.
#define EMIT_SHADE_TAPS 16
// What is shaded lies that much deeper than what shades.
#define EMIT_SHADE_LIFT_M 0.01f
// Texels of a page's side; the outermost ones are those of its neighbours as well.
#define EMIT_PAGE_SIDE 128
#define EMIT_PAGE_TEXELS 3
#define EMIT_SILHOUETTE_TEXELS 4

EMIT_SHARED_BEGIN

// What all pages and silhouettes of a frame share.
struct ShadeParams {
  vec4 slope;                      // xy = way of a shadow per m of height, towards the sun
  vec4 taps[EMIT_SHADE_TAPS / 2];  // places in the unit disc, two each
};

// A page: level ground in squares, "relworld". Read as EMIT_PAGE_TEXELS texels.
struct PageParams {
  vec4 place;      // xy = middle of the first texel, z = height of the plane, m; w = texels per m
  vec4 range;      // x = nothing higher above the plane is shaded, m; y = nor what lies lower, negative; z = layer
  vec4 left_frac;  // by mode: share that is left of what the texels hold
};

// A silhouette where its body stands now, "relworld". Read as EMIT_SILHOUETTE_TEXELS texels.
struct SilhouetteParams {
  vec4 column;    // dot with (p, 1): texels from the first column
  vec4 row;
  vec4 depth_m;
  vec4 penumbra;  // x = mean depth of what shades, m; y = texels per m of the disc's radius per m of depth; z = layer
};

// Square of a picture and what may shade there.
struct ShadeTile {
  uint place_px;      // first column, first row * 65536
  uint first;         // of its entries in the list of pages and silhouettes; pages come first
  uint pages;
  uint silhouettes;
};

EMIT_SHARED_END

#ifdef __cplusplus
#include <cmath>
#include <cstdint>
#include <utility>
namespace emit::renderer {
/// Equal areas, golden angle.
[[nodiscard]] inline std::pair<float, float> shade_tap(std::uint32_t index) noexcept {
  const float radius = std::sqrt((static_cast<float>(index) + 0.5F) / EMIT_SHADE_TAPS);
  const float angle = 2.39996323F * static_cast<float>(index);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}
}  // namespace emit::renderer
#endif
