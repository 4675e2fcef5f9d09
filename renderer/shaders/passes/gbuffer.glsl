// SPDX-License-Identifier: Apache-2.0
// Reading the geometry buffer.
#include "shared/frame_params.glsl.h"
#include "passes/octahedral.glsl"

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame_uniform; };
layout(binding = EMIT_TEX_DEPTH) uniform sampler2D depth_texture;
layout(binding = EMIT_TEX_NORMAL) uniform sampler2D normal_texture;
layout(binding = EMIT_TEX_IDS) uniform usampler2D ids_texture;

// Software rasterisers fetch a uniform for every lane, each time it is used: what is read before a loop over pixels
// is not read again in it. To be called first.
FrameParams frame;
void read_frame() { frame = frame_uniform; }

float gbuffer_depth_m(ivec2 px) { return texelFetch(depth_texture, px, 0).r; }

vec3 gbuffer_normal(ivec2 px) { return unit_from_octahedral(texelFetch(normal_texture, px, 0).rg); }

// x = material, y = object id
uvec2 gbuffer_ids(ivec2 px) { return texelFetch(ids_texture, px, 0).rg; }

// In the sensor's axes, through a pixel's centre, unit length along the boresight.
vec3 sensor_ray(ivec2 px) {
  return vec3((vec2(px) + 0.5) * frame.ray.xy + frame.ray.zw, 1.0);
}

// The same in relworld axes.
vec3 view_ray(ivec2 px) { return mat3(frame.relworld_from_sensor) * sensor_ray(px); }
