// SPDX-License-Identifier: Apache-2.0
// Functions that read the geometry buffer and the parameters of the frame.
#include "shared/frame_params.glsl.h"
#include "passes/octahedral.glsl"

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame_uniform; };
layout(binding = EMIT_TEX_DEPTH) uniform sampler2D depth_texture;
layout(binding = EMIT_TEX_NORMAL) uniform sampler2D normal_texture;
layout(binding = EMIT_TEX_IDS) uniform usampler2D ids_texture;

// Copy of the frame's parameters. Software rasterisers fetch a uniform for every lane at every use, so a value that is
// copied before a loop over pixels is fetched once. A main function calls read_frame() first.
FrameParams frame;
void read_frame() { frame = frame_uniform; }

// Boresight distance of the visible surface in m; EMIT_SKY_DEPTH_M where there is none.
float gbuffer_depth_m(ivec2 px) { return texelFetch(depth_texture, px, 0).r; }

// Unit normal of the visible surface, relworld.
vec3 gbuffer_normal(ivec2 px) { return unit_from_octahedral(texelFetch(normal_texture, px, 0).rg); }

// Numbers of the visible surface: x = material, y = 1 + index of the scenario's object.
uvec2 gbuffer_ids(ivec2 px) { return texelFetch(ids_texture, px, 0).rg; }

// View ray through the centre of a pixel in sensor axes. Its component along the boresight is 1.
vec3 sensor_ray(ivec2 px) {
  return vec3((vec2(px) + 0.5) * frame.ray_per_px + frame.ray_at_corner, 1.0);
}

// View ray through the centre of a pixel in relworld axes. Its component along the boresight is 1.
vec3 view_ray(ivec2 px) { return mat3(frame.relworld_from_sensor) * sensor_ray(px); }
