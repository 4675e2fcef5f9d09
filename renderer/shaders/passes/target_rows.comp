// SPDX-License-Identifier: Apache-2.0
// Adds up the samples of small targets along each row of their windows, within each column of pixels. A sample counts
// where it shows the target itself and nothing in front of it. passes/target_pixels.comp adds up the rows.
#include "passes/targets.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = EMIT_TEX_IDS) uniform usampler2D ids_texture;
layout(std430, binding = EMIT_BIND_OUTPUT) writeonly buffer Rows { float rows[]; };

void main() {
  uint t = gl_WorkGroupID.z;
  uvec2 at = gl_GlobalInvocationID.xy;
  TargetParams target = targets.targets[t];
  if (at.x >= target.place_px.z || at.y >= target.tile.w) return;
  uint width = targets.samples_width;
  int plane = int(targets.samples_plane);
  // Add up the samples between the borders of the column.
  float begin = float(at.x) * target.per_px.x - target.origin.x;
  float end = begin + target.per_px.x;
  ivec2 range = samples_between(begin, end, target.tile.z);
  float radiance[EMIT_BANDS];
  for (uint band = 0u; band < EMIT_BANDS; ++band) radiance[band] = 0.0;
  float covered = 0.0;
  float nearest = 0.0;
  uint nearest_sample = 0u;
  for (int i = range.x; i < range.y; ++i) {
    ivec2 px = ivec2(target.tile.xy) + ivec2(i, int(at.y));
    bool shows = texelFetch(ids_texture, px, 0).r == target.object;
    float depth = shows ? texelFetch(depth_texture, px, 0).r : 0.0;
    float share = depth > 0.0 ? share_between(i, begin, end) : 0.0;
    int index = px.y * int(width) + px.x;
    covered += share;
    for (uint band = 0u; band < EMIT_BANDS; ++band) {
      radiance[band] += share * texelFetch(sample_planes, int(band) * plane + index).r;
    }
    bool nearer = depth > nearest && share > 0.0;
    nearest = nearer ? depth : nearest;
    nearest_sample = nearer ? uint(index) : nearest_sample;
  }
  // Write the sums.
  uint first = row_sums(t, at.y, at.x);
  for (uint band = 0u; band < EMIT_BANDS; ++band) rows[first + band] = radiance[band];
  rows[first + EMIT_BANDS] = covered;
  rows[first + EMIT_BANDS + 1u] = float(nearest_sample);
}
