// SPDX-License-Identifier: Apache-2.0
// Parameters of hot gas, smoke and flares, which are drawn as puffs over the finished image (physics.md section 13).
#pragma once
#include "shared/bindings.glsl.h"
#include "shared/cpp_glsl.glsl.h"
EMIT_SHARED_BEGIN

// Cloud of gas whose density falls off as a Gaussian, round about an axis.
struct GasPuff {
  vec2 centre_px;              // in pixels of the output image
  float range_m;               // distance of the centre
  float kind;                  // sum of EMIT_GAS_*
  vec3 covariance_px2;         // of its image: across, mixed, down
  float per_along_m;           // 1 / standard deviation along the line of sight to the centre
  vec3 centre_m;               // from the sensor, in its axes
  float per_across_m2;         // 1 / variance across the axis
  vec3 axis;                   // unit vector, in the sensor's axes
  float per_along_axis_m2;     // 1 / variance along the axis
  vec4 air_share_frac;         // by band: air's transmittance for its spectrum, by that for a blackbody of its temperature
  vec4 source_w_m2_sr;         // by band: opaque gas as the sensor sees it through the air, or the middle of a flare
  vec4 depth[EMIT_MAX_BANDS];  // by band: optical depth through the centre, by spectral term
};

// Uniform block of one image that gas is drawn over: the output image, or the samples of a small target.
struct GasImage {
  vec2 ray_per_px;       // step of a view ray's tangents to the next column and row of this image
  vec2 ray_at_corner;    // tangents at the outer corner of pixel (0, 0)
  vec2 px_per_tan;       // pixels of the output image per tangent
  vec2 px_at_axis;       // pixel of the output image on the boresight
  vec2 depth_per_px;     // texels of the depth buffer per pixel of this image
  vec2 side_px;          // sides of a pixel of this image in pixels of the output image
  uvec4 window_px;       // first column, first row, end column, end row
  uint width_px;         // columns of the planes
  uint plane_px;         // pixels of a plane
  uint first_tile;       // in the list of tiles
  float near_m;          // boresight distance at which the depth buffer holds 1
  uint tiles;            // number of tiles of this image
  uint unused0;
  uint unused1;
  uint unused2;
  vec4 term_frac[EMIT_MAX_BANDS];  // by band: share of the spectral terms; they add up to 1
};

// Part of an image that gas covers: 16 x 16 pixels.
struct GasTile {
  uvec4 place;      // first column, first row, samples along the side of a pixel, 0
  uvec4 puffs[EMIT_GAS_PUFF_BITS];  // bit per puff, the nearest first
};

#ifdef __cplusplus
static_assert(sizeof(GasPuff) == 96 + 16 * EMIT_MAX_BANDS);
EMIT_SHARED_OFFSET(GasPuff, covariance_px2, 16);
EMIT_SHARED_OFFSET(GasPuff, centre_m, 32);
EMIT_SHARED_OFFSET(GasPuff, axis, 48);
EMIT_SHARED_OFFSET(GasPuff, air_share_frac, 64);
EMIT_SHARED_OFFSET(GasPuff, source_w_m2_sr, 80);
EMIT_SHARED_OFFSET(GasPuff, depth, 96);
static_assert(sizeof(GasImage) == 96 + 16 * EMIT_MAX_BANDS);
EMIT_SHARED_OFFSET(GasImage, window_px, 48);
EMIT_SHARED_OFFSET(GasImage, near_m, 76);
EMIT_SHARED_OFFSET(GasImage, term_frac, 96);
static_assert(sizeof(GasTile) == 16 + 16 * EMIT_GAS_PUFF_BITS);
#endif

EMIT_SHARED_END
