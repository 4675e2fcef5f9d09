// SPDX-License-Identifier: Apache-2.0
// Both passes over the windows of small targets include this file.
//   EMIT_BANDS number of radiance planes
#include "shared/frame_params.glsl.h"
#include "shared/target_params.glsl.h"

layout(std140, binding = EMIT_BIND_TARGETS) uniform Targets { TargetsParams targets; };
layout(binding = EMIT_TEX_DEPTH) uniform sampler2D depth_texture;        // reversed: nearer is larger
layout(binding = EMIT_TEX_TARGET_PLANES) uniform samplerBuffer sample_planes;  // as passes/radiance.comp writes them

// Sums of a row of samples of a target within a column of pixels: radiance by band, share of the row, and the number of
// the sample nearest to the camera.
#define EMIT_TARGET_SUMS (EMIT_BANDS + 2u)

// Place of the first sum of a row. The sums follow each other.
uint row_sums(uint target, uint row, uint column) {
  return ((target * EMIT_TARGET_SIDE + row) * EMIT_TARGET_COLUMNS + column) * EMIT_TARGET_SUMS;
}

// Samples that lie between two borders, in samples from the corner of the window.
ivec2 samples_between(float begin, float end, uint samples) {
  return ivec2(clamp(vec2(floor(begin), ceil(end)), 0.0, float(samples)));
}

// Share of a sample that lies between two borders.
float share_between(int i, float begin, float end) {
  return max(min(float(i) + 1.0, end) - max(float(i), begin), 0.0);
}
