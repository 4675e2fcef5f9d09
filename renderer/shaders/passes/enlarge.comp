// SPDX-License-Identifier: Apache-2.0
// Brings planes that were rendered with fewer pixels to the size of the picture: radiance between the four nearest
// pixels, other planes from the nearest one, as there is nothing between two objects.
//   EMIT_BANDS  number of planes of radiance, which come first
//   EMIT_PLANES number of planes
#include "shared/frame_params.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(binding = EMIT_TEX_SCALED) uniform samplerBuffer scaled_planes;
layout(std430, binding = EMIT_BIND_OUTPUT) writeonly buffer Planes { float planes[]; };

int scaled_index(ivec2 px, uint plane) {
  return int(plane * frame.format_px.z) + px.y * int(frame.format_px.x) + px.x;
}

void main() {
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + frame.picture_window_px.xy);
  if (any(greaterThanEqual(px, ivec2(frame.picture_window_px.zw)))) return;
  ivec2 last = ivec2(frame.format_px.xy) - 1;
  vec2 place = (vec2(px) + 0.5) * vec2(frame.format_px.xy) / vec2(frame.picture_px.xy);
  vec2 way = clamp(place - 0.5, vec2(0.0), vec2(last));
  ivec2 low = ivec2(way);
  ivec2 high = min(low + 1, last);
  vec2 part = way - vec2(low);
  ivec2 nearest = min(ivec2(place), last);
  uint pixel = uint(px.y) * frame.picture_px.x + uint(px.x);
  for (uint i = 0u; i < EMIT_PLANES; ++i) {
    float value;
    if (i < EMIT_BANDS) {
      float top = mix(texelFetch(scaled_planes, scaled_index(low, i)).r, texelFetch(scaled_planes, scaled_index(ivec2(high.x, low.y), i)).r, part.x);
      float bottom = mix(texelFetch(scaled_planes, scaled_index(ivec2(low.x, high.y), i)).r, texelFetch(scaled_planes, scaled_index(high, i)).r, part.x);
      value = mix(top, bottom, part.y);
    } else {
      value = texelFetch(scaled_planes, scaled_index(nearest, i)).r;
    }
    planes[i * frame.picture_px.z + pixel] = value;
  }
}
