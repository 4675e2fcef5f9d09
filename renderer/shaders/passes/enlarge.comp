// SPDX-License-Identifier: Apache-2.0
// Enlarges the planes of a rendered image to the size of the output image. Radiance is interpolated between the four
// nearest pixels. The other planes take the nearest pixel, because there is nothing between two objects.
// Each invocation walks down one column, because neighbours in a column share most of the pixels they read.
//   EMIT_BANDS  number of radiance planes, which come first
//   EMIT_PLANES number of all planes
#include "shared/frame_params.glsl.h"

layout(local_size_x = EMIT_ENLARGE_WIDTH) in;
layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(binding = EMIT_TEX_SCALED) uniform samplerBuffer scaled_planes;
layout(std430, binding = EMIT_BIND_OUTPUT) writeonly buffer Planes { float planes[]; };

void main() {
  // Find the part of the column that this invocation writes.
  ivec2 px = ivec2(gl_WorkGroupID.xy * uvec2(EMIT_ENLARGE_WIDTH, EMIT_ENLARGE_HEIGHT) + frame.output_window_px.xy);
  px.x += int(gl_LocalInvocationID.x);
  ivec2 end = ivec2(frame.output_window_px.zw);
  if (px.x >= end.x) return;
  end.y = min(end.y, px.y + EMIT_ENLARGE_HEIGHT);

  // Find the rendered columns on either side and the weight of the right one.
  int width = int(frame.rendered_px.x);
  ivec2 last = ivec2(frame.rendered_px) - 1;
  vec2 scale = vec2(frame.rendered_px) / vec2(frame.output_px);
  float place_x = (float(px.x) + 0.5) * scale.x;
  float way_x = clamp(place_x - 0.5, 0.0, float(last.x));
  int low_x = int(way_x);
  int high_x = min(low_x + 1, last.x);
  float part_x = way_x - float(low_x);
  int nearest_x = min(int(place_x), last.x);
  uint pixel = uint(px.y) * frame.output_px.x + uint(px.x);

  // Read the uniforms before the loops: software rasterisers fetch a uniform for every lane at every use.
  int scaled_plane_px = int(frame.rendered_plane_px);
  uint plane_px = frame.output_plane_px;
  uint stride_px = frame.output_px.x;
  float top[EMIT_BANDS];
  float bottom[EMIT_BANDS];
  int row = -2;  // rendered row that `bottom` holds
  for (int y = px.y; y < end.y; ++y) {
    float place_y = (float(y) + 0.5) * scale.y;
    float way_y = clamp(place_y - 0.5, 0.0, float(last.y));
    int low_y = int(way_y);
    // Load the next rendered rows. This is a loop and not a branch, because software rasterisers run a branch for
    // every lane but leave a loop as soon as no lane is in it.
    for (row = max(row, low_y - 1); row <= low_y; ) {
      int from = min(++row, last.y) * width;
      for (uint i = 0u; i < EMIT_BANDS; ++i) {
        top[i] = bottom[i];
        bottom[i] = mix(texelFetch(scaled_planes, from + low_x).r, texelFetch(scaled_planes, from + high_x).r, part_x);
        from += scaled_plane_px;
      }
    }
    // Interpolate radiance between the two rows.
    for (uint i = 0u; i < EMIT_BANDS; ++i) {
      planes[i * plane_px + pixel] = mix(top[i], bottom[i], way_y - float(low_y));
    }
    // Copy the other planes from the nearest pixel.
    int nearest = min(int(place_y), last.y) * width + nearest_x;
    for (uint i = EMIT_BANDS; i < EMIT_PLANES; ++i) {
      planes[i * plane_px + pixel] = texelFetch(scaled_planes, int(i) * scaled_plane_px + nearest).r;
    }
    pixel += stride_px;
  }
}
