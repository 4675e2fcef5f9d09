// SPDX-License-Identifier: Apache-2.0
// Reads the clutter of a pixel (physics.md section 14). The field of a material repeats over tiles of EMIT_CLUTTER_SIDE
// texels. A texel of the texture holds the texel of the field and its three neighbours to the right and below, 14 bits each,
// so that bilinear interpolation takes one fetch, and 8 bits of the variance that the level has lost. Levels come in pairs
// of a side and three quarters of it; pair j begins at row 2 SIDE - (2 SIDE >> j) of the field, and its second level stands
// beside the first.
layout(binding = EMIT_TEX_CLUTTER) uniform usampler2D clutter_fields;
layout(binding = EMIT_TEX_CLUTTER_PIXELS) uniform usampler2D clutter_pixels;

// Levels between that whose texels are as wide as a pixel and the one that smooths like the pixel.
#define EMIT_CLUTTER_FINER 1.4

// Clutter of a pixel. Without clutter all members are 0.
struct Clutter {
  float sd;           // mean of the field over the pixel, standard deviations
  float shift_k;      // change of the mean temperature
  float variance_k2;  // variance of the temperature within the pixel
};

// Field at a place of a level, and the variance that the level has lost. `place` counts tiles.
vec2 clutter_field(int first_row, int level, vec2 place) {
  int pair = level >> 1;
  bool second = (level & 1) != 0;
  int side = (second ? EMIT_CLUTTER_SIDE / 4 * 3 : EMIT_CLUTTER_SIDE) >> pair;
  ivec2 first = ivec2(second ? EMIT_CLUTTER_SIDE >> pair : 0,
                      first_row + 2 * EMIT_CLUTTER_SIDE - (2 * EMIT_CLUTTER_SIDE >> pair));
  // Texel 0 has its middle at the origin at every level.
  vec2 texel = fract(place) * float(side);
  vec2 corner = min(floor(texel), float(side - 1));
  vec2 part = texel - corner;
  uvec2 four = texelFetch(clutter_fields, first + ivec2(corner), 0).rg;
  vec2 left = vec2(four & 16383u);
  vec2 right = vec2(four >> 14 & 16383u);
  vec2 rows = mix(left, right, part.x);
  float steps = mix(rows.x, rows.y, part.y);
  uint lost = four.x >> 28 | four.y >> 28 << 4;
  return vec2((steps - 8191.5) * (EMIT_CLUTTER_MOST_SD / 8191.5), float(lost) / 255.0);
}

// Averages the field over a pixel: up to EMIT_CLUTTER_TAPS places along the longer side of its footprint, at a level
// whose texels are about as wide as the shorter one.
Clutter clutter_at(ivec2 px) {
  uvec4 packed_texel = texelFetch(clutter_pixels, px, 0);
  int field = int(packed_texel.y & 255u);
  if (field == 0) return Clutter(0.0, 0.0, 0.0);
  vec2 place = vec2(packed_texel.xy >> 8) / EMIT_CLUTTER_PLACE_STEPS;
  vec2 longer = unpackHalf2x16(packed_texel.z);
  vec2 slope_k = unpackHalf2x16(packed_texel.w);
  int first_row = (field - 1) * (2 * EMIT_CLUTTER_SIDE);
  float length_tx = length(longer);
  float width_tx = length_tx * max(float(packed_texel.x & 255u) / 255.0, 1.0 / float(EMIT_CLUTTER_TAPS));
  int taps = clamp(int(ceil(length_tx / max(width_tx, 1.0))), 1, EMIT_CLUTTER_TAPS);
  // A level and its interpolation smooth like the box of a pixel that is 2.6 texels wide.
  float levels = 2.0 * (log2(max(width_tx, 1e-3)) - EMIT_CLUTTER_FINER) + 0.5;
  int level = clamp(int(floor(levels)), 0, EMIT_CLUTTER_LEVELS - 1);
  vec2 step_tiles = longer / (float(taps) * float(EMIT_CLUTTER_SIDE));
  vec2 at = place - 0.5 * float(taps - 1) * step_tiles;
  vec3 sum = vec3(0.0);
  for (int tap = 0; tap < taps; ++tap) {
    vec2 found = clutter_field(first_row, level, at);
    sum += vec3(found.x, found.x * found.x, found.y);
    at += step_tiles;
  }
  sum /= float(taps);
  float sd = sum.x;
  // The field varies within the pixel from tap to tap, and by what its level has lost.
  float variance = max(sum.y - sd * sd, 0.0) + sum.z;
  float slope = slope_k.x + 2.0 * slope_k.y * sd;
  return Clutter(sd, sd * slope_k.x + (sd * sd + variance) * slope_k.y, variance * slope * slope);
}
