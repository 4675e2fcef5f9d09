// SPDX-License-Identifier: Apache-2.0
// Reads the clutter of a pixel (physics.md section 14). The field of a material repeats over tiles of EMIT_CLUTTER_SIDE
// texels. Its levels come in pairs of a side and three quarters of it, and lie row by row in a buffer: what a frame
// reads of a level then stays in the caches, where the rows of a texture that holds all levels would be pages apart. A
// texel holds the field and its neighbour in the row as short floats, so that bilinear interpolation takes two fetches;
// row 0 stands behind the last one again. A head has a word per level of each field: the first texel in units of four,
// and 8 bits of the variance that the level has lost.
#include "passes/short_floats.glsl"

layout(binding = EMIT_TEX_CLUTTER) uniform usamplerBuffer clutter_fields;
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
  vec2 place = vec2(packed_texel.xy >> 8) / EMIT_CLUTTER_PLACE_STEPS;
  vec2 longer = short_floats(packed_texel.z);
  vec2 slope_k = short_floats(packed_texel.w);
  float length_tx = length(longer);
  float width_tx = length_tx * max(float(packed_texel.x & 255u) / 255.0, 1.0 / float(EMIT_CLUTTER_TAPS));
  // A level and its interpolation smooth like the box of a pixel that is 2.6 texels wide. Two levels are an octave, so
  // that the exponent of the squared width is that level, rounded to the nearest.
  int exponent = floatBitsToInt(width_tx * width_tx * EMIT_CLUTTER_FINER) >> 23;
  int level = clamp(exponent - 127, 0, EMIT_CLUTTER_LEVELS - 1);
  int side_tx = ((level & 1) != 0 ? EMIT_CLUTTER_SIDE / 4 * 3 : EMIT_CLUTTER_SIDE) >> (level >> 1);
  uint head = texelFetch(clutter_fields, max(field - 1, 0) * EMIT_CLUTTER_LEVELS + level).r;
  int first = int(head >> 8) * 4;
  float lost = float(int(head & 255u)) / 255.0;
  float side = float(side_tx);
  float length_frac = length_tx / float(EMIT_CLUTTER_SIDE);
  int taps = clamp(int(ceil(length_frac * side / EMIT_CLUTTER_STEP)), 1, EMIT_CLUTTER_TAPS);
  float per_tap = 1.0 / float(taps);
  vec2 step_tiles = longer * (per_tap / float(EMIT_CLUTTER_SIDE));
  vec2 at = place - 0.5 * float(taps - 1) * step_tiles;
  vec2 sum = vec2(0.0);
  for (int tap = 0; tap < taps; ++tap) {
    // Texel 0 has its middle at the origin at every level.
    vec2 texel = fract(at) * side;
    vec2 corner = min(floor(texel), side - 1.0);
    vec2 part = texel - corner;
    int index = first + int(corner.y * side + corner.x);
    vec2 upper = short_floats(texelFetch(clutter_fields, index).r);
    vec2 lower = short_floats(texelFetch(clutter_fields, index + side_tx).r);
    vec2 columns = mix(upper, lower, part.y);
    float sd = mix(columns.x, columns.y, part.x);
    sum += vec2(sd, sd * sd);
    at += step_tiles;
  }
  // The field varies within the pixel from tap to tap, and by what its level has lost. Where the material has no field
  // the code selects and does not return before, because a return makes software rasterisers mask all that follows it.
  bool varies = field != 0;
  float mean = sum.x * per_tap;
  float sd = varies ? mean : 0.0;
  float variance = varies ? max(sum.y * per_tap - mean * mean, 0.0) + lost : 0.0;
  float slope = slope_k.x + 2.0 * slope_k.y * sd;
  return Clutter(sd, sd * slope_k.x + (sd * sd + variance) * slope_k.y, variance * slope * slope);
}
