// SPDX-License-Identifier: Apache-2.0
// Reads the clutter of a pixel (physics.md section 14). The field of a material repeats over tiles of EMIT_CLUTTER_SIDE
// texels. A texel of the texture holds the texel of the field and its three neighbours to the right and below, 14 bits each,
// so that bilinear interpolation takes one fetch, and 8 bits of the variance that the level has lost. Levels come in pairs
// of a side and three quarters of it; pair j begins at row 2 SIDE - (2 SIDE >> j) of the field, and its second level stands
// beside the first.
#include "passes/short_floats.glsl"

layout(binding = EMIT_TEX_CLUTTER) uniform usampler2D clutter_fields;
layout(binding = EMIT_TEX_CLUTTER_PIXELS) uniform usampler2D clutter_pixels;

// Factor that turns the squared width of a pixel, in texels, into 2 to the power of the level that smooths like it. The
// level lies 1.4 octaves below that whose texels are as wide as the pixel: exp2(0.5 - 2 * 1.4).
#define EMIT_CLUTTER_FINER 0.20306

// Clutter of a pixel. Without clutter all members are 0.
struct Clutter {
  float sd;           // mean of the field over the pixel, standard deviations
  float shift_k;      // change of the mean temperature
  float variance_k2;  // variance of the temperature within the pixel
};

// Widest step between two places, in texels of their level: a level holds nothing above 0.3 waves per texel, so that
// places as far apart as a wave of that length still add up to a mean without ripples.
#define EMIT_CLUTTER_STEP (1.0 / 0.3)

// Averages the field over a pixel: up to EMIT_CLUTTER_TAPS places along the longer side of its footprint, at a level
// whose texels are about as wide as the shorter one.
Clutter clutter_at(ivec2 px) {
  uvec4 packed_texel = texelFetch(clutter_pixels, px, 0);
  int field = int(packed_texel.y & 255u);
  if (field == 0) return Clutter(0.0, 0.0, 0.0);
  vec2 place = vec2(packed_texel.xy >> 8) / EMIT_CLUTTER_PLACE_STEPS;
  vec2 longer = short_floats(packed_texel.z);
  vec2 slope_k = short_floats(packed_texel.w);
  float length_tx = length(longer);
  float width_tx = length_tx * max(float(packed_texel.x & 255u) / 255.0, 1.0 / float(EMIT_CLUTTER_TAPS));
  // A level and its interpolation smooth like the box of a pixel that is 2.6 texels wide. Two levels are an octave, so
  // that the exponent of the squared width is that level, rounded to the nearest.
  int exponent = floatBitsToInt(width_tx * width_tx * EMIT_CLUTTER_FINER) >> 23;
  int level = clamp(exponent - 127, 0, EMIT_CLUTTER_LEVELS - 1);
  int pair = level >> 1;
  bool second = (level & 1) != 0;
  int side_tx = (second ? EMIT_CLUTTER_SIDE / 4 * 3 : EMIT_CLUTTER_SIDE) >> pair;
  ivec2 first = ivec2(second ? EMIT_CLUTTER_SIDE >> pair : 0,
                      field * (2 * EMIT_CLUTTER_SIDE) - (2 * EMIT_CLUTTER_SIDE >> pair));
  float side = float(side_tx);
  float length_frac = length_tx / float(EMIT_CLUTTER_SIDE);
  int taps = clamp(int(ceil(length_frac * side / EMIT_CLUTTER_STEP)), 1, EMIT_CLUTTER_TAPS);
  float per_tap = 1.0 / float(taps);
  vec2 step_tiles = longer * (per_tap / float(EMIT_CLUTTER_SIDE));
  vec2 at = place - 0.5 * float(taps - 1) * step_tiles;
  vec2 sum = vec2(0.0);
  uvec2 four = uvec2(0u);
  for (int tap = 0; tap < taps; ++tap) {
    // Texel 0 has its middle at the origin at every level.
    vec2 texel = fract(at) * side;
    vec2 corner = min(floor(texel), side - 1.0);
    vec2 part = texel - corner;
    four = texelFetch(clutter_fields, first + ivec2(corner), 0).rg;
    vec2 rows = mix(vec2(four & 16383u), vec2(four >> 14 & 16383u), part.x);
    float steps = mix(rows.x, rows.y, part.y) - 8191.5;
    sum += vec2(steps, steps * steps);
    at += step_tiles;
  }
  // All texels of a level hold the same variance that the level has lost.
  float lost = float(four.x >> 28 | four.y >> 28 << 4) / 255.0;
  const float sd_per_step = EMIT_CLUTTER_MOST_SD / 8191.5;
  float mean = sum.x * per_tap;
  float sd = mean * sd_per_step;
  // The field varies within the pixel from tap to tap, and by what its level has lost.
  float variance = max(sum.y * per_tap - mean * mean, 0.0) * (sd_per_step * sd_per_step) + lost;
  float slope = slope_k.x + 2.0 * slope_k.y * sd;
  return Clutter(sd, sd * slope_k.x + (sd * sd + variance) * slope_k.y, variance * slope * slope);
}
