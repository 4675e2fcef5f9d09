// SPDX-License-Identifier: Apache-2.0
// Brings planes that were rendered with fewer pixels to the size of the picture: radiance between the four nearest
// pixels, other planes from the nearest one, as there is nothing between two objects.
// Each invocation goes down a column: neighbours in it have most of what they are made of in common.
//   EMIT_BANDS  number of planes of radiance, which come first
//   EMIT_PLANES number of planes
#include "shared/frame_params.glsl.h"

layout(local_size_x = EMIT_ENLARGE_WIDTH) in;
layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(binding = EMIT_TEX_SCALED) uniform samplerBuffer scaled_planes;
layout(std430, binding = EMIT_BIND_OUTPUT) writeonly buffer Planes { float planes[]; };

void main() {
  ivec2 px = ivec2(gl_WorkGroupID.xy * uvec2(EMIT_ENLARGE_WIDTH, EMIT_ENLARGE_HEIGHT) + frame.picture_window_px.xy);
  px.x += int(gl_LocalInvocationID.x);
  ivec2 behind = ivec2(frame.picture_window_px.zw);
  if (px.x >= behind.x) return;
  behind.y = min(behind.y, px.y + EMIT_ENLARGE_HEIGHT);
  int width = int(frame.format_px.x);
  ivec2 last = ivec2(frame.format_px.xy) - 1;
  vec2 scale = vec2(frame.format_px.xy) / vec2(frame.picture_px.xy);
  float place_x = (float(px.x) + 0.5) * scale.x;
  float way_x = clamp(place_x - 0.5, 0.0, float(last.x));
  int low_x = int(way_x);
  int high_x = min(low_x + 1, last.x);
  float part_x = way_x - float(low_x);
  int nearest_x = min(int(place_x), last.x);
  uint pixel = uint(px.y) * frame.picture_px.x + uint(px.x);
  // Not in the loops: software rasterisers fetch a uniform for every lane, each time.
  int scaled_plane_px = int(frame.format_px.z);
  uint plane_px = frame.picture_px.z;
  uint stride_px = frame.picture_px.x;
  float top[EMIT_BANDS];
  float bottom[EMIT_BANDS];
  int row = -2;  // of `bottom`
  for (int y = px.y; y < behind.y; ++y) {
    float place_y = (float(y) + 0.5) * scale.y;
    float way_y = clamp(place_y - 0.5, 0.0, float(last.y));
    int low_y = int(way_y);
    // A loop, as software rasterisers leave those that nobody is in.
    for (row = max(row, low_y - 1); row <= low_y; ) {
      int from = min(++row, last.y) * width;
      for (uint i = 0u; i < EMIT_BANDS; ++i) {
        top[i] = bottom[i];
        bottom[i] = mix(texelFetch(scaled_planes, from + low_x).r, texelFetch(scaled_planes, from + high_x).r, part_x);
        from += scaled_plane_px;
      }
    }
    for (uint i = 0u; i < EMIT_BANDS; ++i) {
      planes[i * plane_px + pixel] = mix(top[i], bottom[i], way_y - float(low_y));
    }
    int nearest = min(int(place_y), last.y) * width + nearest_x;
    for (uint i = EMIT_BANDS; i < EMIT_PLANES; ++i) {
      planes[i * plane_px + pixel] = texelFetch(scaled_planes, int(i) * scaled_plane_px + nearest).r;
    }
    pixel += stride_px;
  }
}
