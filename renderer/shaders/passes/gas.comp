// SPDX-License-Identifier: Apache-2.0
// Draws hot gas, smoke and flares over a finished image: puffs of gas along the line of sight, from the nearest to the
// farthest, emit through what lies before them and weaken what lies behind (physics.md eq. 55). A work group takes one
// tile of the list.
//   EMIT_BANDS   number of radiance planes, which come first
//   EMIT_CACHED  the depth buffer holds the reversed depth; otherwise the boresight distance
#include "shared/gas_params.glsl.h"
#include "shared/frame_params.glsl.h"
#include "lib/gas_puff.glsl"

layout(local_size_x = EMIT_GAS_TILE, local_size_y = EMIT_GAS_TILE) in;
layout(std140, binding = EMIT_BIND_GAS) uniform Image { GasImage image; };
layout(std430, binding = EMIT_BIND_OUTPUT) buffer Planes { float planes[]; };
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };
layout(binding = EMIT_TEX_DEPTH) uniform sampler2D depth_texture;
layout(binding = EMIT_TEX_GAS_PUFFS) uniform samplerBuffer puff_texels;
layout(std430, binding = EMIT_BIND_GAS_TILES) readonly buffer Tiles { GasTile tiles[]; };

const int kTexelsPerPuff = 6 + EMIT_MAX_BANDS;

// Gas of one line of sight from the sensor on, by band and spectral term: what it lets through, the share of what lies
// behind that it takes away from the aperture, and what it adds there.
struct Gas {
  vec4 through[EMIT_BANDS];
  vec4 taken[EMIT_BANDS];
  vec4 added[EMIT_BANDS];
};

// Relative column of a puff at a place of the output image: 1 on the line through its middle. `ray` is the unit vector of
// the line of sight, `side_px` are the sides of what it stands for, and `surface_m` is the distance at which it ends.
float column(int puff, vec2 px, vec3 ray, vec2 side_px, float surface_m) {
  vec4 place = texelFetch(puff_texels, puff);
  vec4 image_shape = texelFetch(puff_texels, puff + 1);
  uint kind = uint(place.w);
  if ((kind & EMIT_GAS_SMALL) != 0u) {
    int parts = int(max(kind >> EMIT_GAS_SAMPLES_SHIFT, 1u));
    vec2 part_px = side_px / float(parts);
    vec2 first = px - place.xy - 0.5 * (side_px - part_px);
    float sum = 0.0;
    for (int i = 0; i < parts * parts; ++i) {
      sum += gas_image_column(first + vec2(i % parts, i / parts) * part_px, image_shape.xyz, part_px);
    }
    return sum / float(parts * parts) * gas_before(place.z * image_shape.w, surface_m * image_shape.w);
  }
  // A large puff may be near, beside or around the sensor: take its density along the line itself.
  vec4 middle = texelFetch(puff_texels, puff + 2);
  vec4 axis = texelFetch(puff_texels, puff + 3);
  vec3 line = gas_line(ray, middle.xyz, middle.w, axis);
  return exp(-0.5 * line.x) * line.z * image_shape.w * gas_before(line.y / line.z, surface_m / line.z);
}

void add_puff(inout Gas gas, int puff, float share) {
  bool flare = (uint(texelFetch(puff_texels, puff).w) & EMIT_GAS_FLARE) != 0u;
  vec4 air_share = texelFetch(puff_texels, puff + 4);
  vec4 source = texelFetch(puff_texels, puff + 5);
  for (int i = 0; i < EMIT_BANDS; ++i) {
    vec4 passed = exp(-share * texelFetch(puff_texels, puff + 6 + i));
    vec4 emitted = flare ? vec4(share) : 1.0 - passed;
    // The air has taken a part of the spectrum of the gas away, in which gas neither adds nor takes.
    vec4 counted = gas.through[i] * air_share[i];
    gas.added[i] += counted * emitted * source[i];
    gas.taken[i] += counted * (1.0 - passed);
    gas.through[i] *= passed;
  }
}

void main() {
  uint index = gl_WorkGroupID.y * EMIT_GAS_DISPATCH_COLUMNS + gl_WorkGroupID.x;
  if (index >= image.tiles) return;
  uint tile = image.first_tile + index;
  uvec4 tile_place = tiles[tile].place;
  ivec2 px = ivec2(tile_place.xy + gl_LocalInvocationID.xy);
  if (any(lessThan(px, ivec2(image.window_px.xy))) || any(greaterThanEqual(px, ivec2(image.window_px.zw)))) return;
  // Find where the line of sight ends.
  vec2 tan = (vec2(px) + 0.5) * image.ray_per_px + image.ray_at_corner;
  float depth = texelFetch(depth_texture, ivec2((vec2(px) + 0.5) * image.depth_per_px), 0).r;
#ifdef EMIT_CACHED
  float boresight_m = depth > 0.0 ? image.near_m / depth : EMIT_SKY_DEPTH_M;
#else
  float boresight_m = depth;
#endif
  float surface_m = min(boresight_m, EMIT_GAS_FAR_M) * length(vec3(tan, 1.0));
  // Add up the samples of the pixel. There are several where gas is smaller than the pixel.
  float through[EMIT_BANDS];
  float added[EMIT_BANDS];
  for (int i = 0; i < EMIT_BANDS; ++i) {
    through[i] = 0.0;
    added[i] = 0.0;
  }
  int samples = int(tile_place.z);
  vec2 side_px = image.side_px / float(samples);
  for (int sample_index = 0; sample_index < samples * samples; ++sample_index) {
    vec2 in_px = (vec2(sample_index % samples, sample_index / samples) + 0.5) / float(samples) - 0.5;
    vec2 sample_tan = tan + in_px * image.ray_per_px;
    vec2 place_px = sample_tan * image.px_per_tan + image.px_at_axis;
    vec3 ray = normalize(vec3(sample_tan, 1.0));
    Gas gas;
    for (int i = 0; i < EMIT_BANDS; ++i) {
      gas.through[i] = vec4(1.0);
      gas.taken[i] = vec4(0.0);
      gas.added[i] = vec4(0.0);
    }
    for (int word = 0; word < 4 * EMIT_GAS_PUFF_BITS; ++word) {
      uint bits = tiles[tile].puffs[word / 4][word % 4];
      while (bits != 0u) {
        int puff = kTexelsPerPuff * (32 * word + findLSB(bits));
        bits &= bits - 1u;
        add_puff(gas, puff, column(puff, place_px, ray, side_px, surface_m));
      }
    }
    for (int i = 0; i < EMIT_BANDS; ++i) {
      through[i] += 1.0 - dot(image.term_frac[i], gas.taken[i]);
      added[i] += dot(image.term_frac[i], gas.added[i]);
    }
  }
  // Put the gas over the pixel.
  float per_sample = 1.0 / float(samples * samples);
  uint pixel = uint(px.y) * image.width_px + uint(px.x);
  bool finite = true;
  for (int i = 0; i < EMIT_BANDS; ++i) {
    uint place = uint(i) * image.plane_px + pixel;
    float radiance_w_m2_sr = (planes[place] * through[i] + added[i]) * per_sample;
    bool good = !(isnan(radiance_w_m2_sr) || isinf(radiance_w_m2_sr));
    finite = finite && good;
    planes[place] = good ? radiance_w_m2_sr : 0.0;
  }
  if (!finite) atomicAdd(stats.flagged_px[EMIT_FLAG_NONFINITE], 1u);
}
