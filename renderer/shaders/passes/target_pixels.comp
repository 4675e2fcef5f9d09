// SPDX-License-Identifier: Apache-2.0
// Puts small targets into the output image. A pixel keeps the radiance behind the targets for the part that none of
// them covers: L = (1 - sum c) L_background + sum of the targets' radiance times their share of the pixel. Samples that
// another body hides do not count, so the shares of a pixel are disjoint and the order of targets does not matter.
// The other planes take the sample that is nearest to the camera, wherever a target has a share of the pixel.
//   EMIT_PLANES   number of planes that show surfaces
//   EMIT_COVERAGE 1: one more plane holds the share of the pixel that targets cover
#include "passes/targets.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(binding = EMIT_TEX_TARGET_ROWS) uniform samplerBuffer rows;  // as passes/target_rows.comp writes them
layout(std430, binding = EMIT_BIND_OUTPUT) buffer Planes { float planes[]; };
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };
layout(std430, binding = EMIT_BIND_TARGET_STATS) readonly buffer TargetStats { FrameStatsGpu target_stats; };

// True when the window of a target touches a pixel.
bool touches(uint t, uvec2 px) {
  uvec4 place = targets.targets[t].place_px;
  return all(greaterThanEqual(px, place.xy)) && all(lessThan(px, place.xy + place.zw));
}

void main() {
  uint t = gl_WorkGroupID.z;
  uvec2 at = gl_GlobalInvocationID.xy;
  // Count one pixel for each flag that samples of the targets have.
  if (t == 0u && at == uvec2(0u)) {
    for (int flags = 1; flags < 4; ++flags) {
      if (target_stats.flagged_px[flags] > 0u) atomicAdd(stats.flagged_px[flags], 1u);
    }
  }
  uvec4 place = targets.targets[t].place_px;
  if (any(greaterThanEqual(at, place.zw))) return;
  uvec2 px = place.xy + at;
  if (any(lessThan(px, frame.output_window_px.xy)) || any(greaterThanEqual(px, frame.output_window_px.zw))) return;
  // The first target that touches a pixel writes it for all of them.
  for (uint before = 0u; before < t; ++before) {
    if (touches(before, px)) return;
  }
  float radiance[EMIT_BANDS];
  for (uint band = 0u; band < EMIT_BANDS; ++band) radiance[band] = 0.0;
  float covered = 0.0;
  float nearest = 0.0;
  int nearest_sample = 0;
  for (uint i = t; i < targets.count; ++i) {
    if (!touches(i, px)) continue;
    TargetParams target = targets.targets[i];
    uvec2 own = px - target.place_px.xy;
    float begin = float(own.y) * target.per_px.y - target.origin.y;
    float end = begin + target.per_px.y;
    ivec2 range = samples_between(begin, end, target.tile.w);
    float px_per_sample = 1.0 / (target.per_px.x * target.per_px.y);
    for (int row = range.x; row < range.y; ++row) {
      int first = int(row_sums(i, uint(row), own.x));
      float in_row = texelFetch(rows, first + int(EMIT_BANDS)).r;
      float share = in_row > 0.0 ? share_between(row, begin, end) * px_per_sample : 0.0;
      if (share <= 0.0) continue;
      covered += share * in_row;
      for (uint band = 0u; band < EMIT_BANDS; ++band) radiance[band] += share * texelFetch(rows, first + int(band)).r;
      int index = int(texelFetch(rows, first + int(EMIT_BANDS) + 1).r);
      int width = int(targets.samples_width);
      float depth = texelFetch(depth_texture, ivec2(index % width, index / width), 0).r;
      bool nearer = depth > nearest;
      nearest = nearer ? depth : nearest;
      nearest_sample = nearer ? index : nearest_sample;
    }
  }
  if (covered <= 0.0) return;
  uint pixel = px.y * frame.output_px.x + px.x;
  uint plane_px = frame.output_plane_px;
  float left = max(1.0 - covered, 0.0);
  for (uint band = 0u; band < EMIT_BANDS; ++band) {
    uint out_index = band * plane_px + pixel;
    planes[out_index] = left * planes[out_index] + radiance[band];
  }
  for (uint plane = EMIT_BANDS; plane < EMIT_PLANES; ++plane) {
    planes[plane * plane_px + pixel] = texelFetch(sample_planes, int(plane * targets.samples_plane) + nearest_sample).r;
  }
#if EMIT_COVERAGE
  planes[EMIT_PLANES * plane_px + pixel] = min(covered, 1.0);
#endif
}
