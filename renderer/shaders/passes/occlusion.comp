// SPDX-License-Identifier: Apache-2.0
// Volumetric obscurance by line sampling (Loos and Sloan 2010): the share of a ball around the surface point that lies
// in front of the depth buffer. Flat ground gives 0.5, a concave place less, a convex place more. Samples come in pairs
// mirrored about the point. On any plane the two open lengths of a pair add up to one chord, so a flat surface is exact
// at any tilt.
#include "passes/gbuffer.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = EMIT_IMG_OCCLUSION) writeonly uniform image2D occlusion_image;

const int kPairs = 13;
// Radius in pixels below which a ball covers no neighbour. The surface then counts as flat.
const float kMinRadiusPx = 1.0;

// Open length in m of the line through a sample, 0..2 * half_m. It is negative when the sample gives no information,
// because it lies outside the image or something in front of the ball hides it.
float open_length_m(ivec2 px, float centre_m, float half_m, float radius_m) {
  if (any(lessThan(px, ivec2(0))) || any(greaterThanEqual(px, ivec2(frame.rendered_px)))) return -1.0;
  float depth_m = gbuffer_depth_m(px);
  if (depth_m < centre_m - 2.0 * radius_m) return -1.0;
  return clamp(depth_m - (centre_m - half_m), 0.0, 2.0 * half_m);
}

void main() {
  // Leave pixels outside the window and pixels of the sky.
  read_frame();
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + frame.rendered_window_px.xy);
  if (any(greaterThanEqual(px, ivec2(frame.rendered_window_px.zw)))) return;
  float centre_m = gbuffer_depth_m(px);
  if (centre_m >= EMIT_SKY_DEPTH_M) return;

  float radius_m = frame.obscurance_radius_m;
  float radius_px = radius_m / (centre_m * frame.ray_per_px.x);
  float open_m = 0.0;
  float full_m = 0.0;
  if (radius_px >= kMinRadiusPx) {
    for (int i = 0; i < kPairs; ++i) {
      // Place the sample: equal areas over the disc, golden-section angles over half a turn. Its mirror fills the
      // other half.
      float r = sqrt((float(i) + 0.5) / float(kPairs));
      float angle = EMIT_PI * fract(float(i) * 0.61803399);
      vec2 wanted_px = r * radius_px * vec2(cos(angle), sin(angle));
      ivec2 offset_px = ivec2(round(wanted_px));
      vec2 unit = vec2(offset_px) / radius_px;
      float half_m = radius_m * sqrt(max(1.0 - dot(unit, unit), 0.0));
      // Measure both lines of the pair.
      float a = open_length_m(px + offset_px, centre_m, half_m, radius_m);
      float b = open_length_m(px - offset_px, centre_m, half_m, radius_m);
      // Replace a missing length by that of a plane.
      if (a < 0.0 && b < 0.0) a = b = half_m;
      if (a < 0.0) a = 2.0 * half_m - b;
      if (b < 0.0) b = 2.0 * half_m - a;
      open_m += a + b;
      full_m += 4.0 * half_m;
    }
  }
  imageStore(occlusion_image, px, vec4(full_m > 0.0 ? open_m / full_m : 0.5));
}
