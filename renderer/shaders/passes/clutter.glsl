// SPDX-License-Identifier: Apache-2.0
// Reads the clutter of a pixel (physics.md section 14). The field of a material repeats over tiles of EMIT_CLUTTER_SIDE
// texels. A texel of the texture holds the texel of the field and its three neighbours to the right and below, so that
// bilinear interpolation takes one fetch. Each field takes EMIT_CLUTTER_SIDE columns: the finest level, below it the
// coarser ones side by side, and beside them the variance that each level keeps.
layout(binding = EMIT_TEX_CLUTTER) uniform usampler2D clutter_fields;
layout(binding = EMIT_TEX_CLUTTER_PIXELS) uniform usampler2D clutter_pixels;

// Levels by which a pixel takes a finer level than that whose texels are as wide as it.
#define EMIT_CLUTTER_FINER 0.6

// Clutter of a pixel. Without clutter all members are 0.
struct Clutter {
  float sd;           // mean of the field over the pixel, standard deviations
  float shift_k;      // change of the mean temperature
  float variance_k2;  // variance of the temperature within the pixel
};

// Field at a place of a level. `place` counts tiles.
float clutter_field(int first_row, int level, vec2 place) {
  int side = EMIT_CLUTTER_SIDE >> level;
  vec2 texel = place * float(side);  // texel 0 has its middle at the origin at every level
  vec2 corner = floor(texel);
  vec2 part = texel - corner;
  ivec2 first = level == 0 ? ivec2(0, first_row) : ivec2(EMIT_CLUTTER_SIDE - 2 * side, first_row + EMIT_CLUTTER_SIDE);
  uvec2 four = texelFetch(clutter_fields, first + (ivec2(corner) & (side - 1)), 0).rg;
  vec2 upper = unpackSnorm2x16(four.x);
  vec2 lower = unpackSnorm2x16(four.y);
  vec2 left_right = mix(upper, lower, part.y);
  return mix(left_right.x, left_right.y, part.x) * EMIT_CLUTTER_MOST_SD;
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
  int first_row = (field - 1) * (EMIT_CLUTTER_SIDE + EMIT_CLUTTER_SIDE / 2);
  float length_tx = length(longer);
  float width_tx = length_tx * max(float(packed_texel.x & 255u) / 255.0, 1.0 / float(EMIT_CLUTTER_TAPS));
  int taps = clamp(int(ceil(length_tx / max(width_tx, 1.0))), 1, EMIT_CLUTTER_TAPS);
  // Bilinear interpolation and the Gaussian of a level smooth more than the box of a pixel as wide as its texel.
  float level = clamp(log2(max(width_tx, 1e-3)) - EMIT_CLUTTER_FINER, 0.0, float(EMIT_CLUTTER_LEVELS - 2));
  int finer = int(level);
  float part = level - float(finer);
  float sum = 0.0;
  vec2 step_tiles = longer / (float(taps) * float(EMIT_CLUTTER_SIDE));
  vec2 at = place - 0.5 * float(taps - 1) * step_tiles;
  for (int tap = 0; tap < taps; ++tap) {
    sum += mix(clutter_field(first_row, finer, at), clutter_field(first_row, finer + 1, at), part);
    at += step_tiles;
  }
  float sd = sum / float(taps);
  // The field varies within the pixel by what its mean over such an area has lost.
  float middle = clamp(0.5 * log2(max(length_tx * width_tx, 1e-6)) - EMIT_CLUTTER_FINER, 0.0,
                       float(EMIT_CLUTTER_LEVELS - 2));
  int wide = int(middle);
  ivec2 kept = ivec2(EMIT_CLUTTER_SIDE - 1, first_row + EMIT_CLUTTER_SIDE + wide);
  float variance = 1.0 - mix(uintBitsToFloat(texelFetch(clutter_fields, kept, 0).r),
                             uintBitsToFloat(texelFetch(clutter_fields, kept + ivec2(0, 1), 0).r),
                             middle - float(wide));
  float slope = slope_k.x + 2.0 * slope_k.y * sd;
  return Clutter(sd, sd * slope_k.x + (sd * sd + variance) * slope_k.y, variance * slope * slope);
}
