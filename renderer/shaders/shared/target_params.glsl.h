// SPDX-License-Identifier: Apache-2.0
// Parameters of small targets, which are drawn into windows of their own (physics.md section 12).
#pragma once
#include "shared/bindings.glsl.h"
#include "shared/cpp_glsl.glsl.h"
EMIT_SHARED_BEGIN

// Window of one target. Its samples lie in a tile of the buffer of all windows.
struct TargetParams {
  uvec4 tile;      // first column and row in the buffer, columns and rows of the tile
  uvec4 place_px;  // first column and row of the output image that the window touches, then their number
  vec2 origin;     // corner of the window behind the first pixel, in samples
  vec2 per_px;     // samples per pixel of the output image, across and down
  uint object;     // 1 + index of the scenario's object
  uint unused0;
  uint unused1;
  uint unused2;
};

// Uniform block of all targets of a frame.
struct TargetsParams {
  TargetParams targets[EMIT_MAX_TARGETS];
  uint count;         // entries of `targets`
  uint samples_width; // columns of the buffer of all windows
  uint samples_plane; // number of its samples
  uint unused0;
};

#ifdef __cplusplus
static_assert(sizeof(TargetParams) == 64);
EMIT_SHARED_OFFSET(TargetParams, place_px, 16);
EMIT_SHARED_OFFSET(TargetParams, origin, 32);
EMIT_SHARED_OFFSET(TargetParams, object, 48);
static_assert(sizeof(TargetsParams) == 64 * EMIT_MAX_TARGETS + 16);
EMIT_SHARED_OFFSET(TargetsParams, count, 64 * EMIT_MAX_TARGETS);
#endif

EMIT_SHARED_END
