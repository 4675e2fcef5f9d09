// SPDX-License-Identifier: Apache-2.0
// Packs what a pixel shows of a sampled surface into 64 bits, because software rasterisers take longer for every byte
// of a texel. The fields from the highest bit on are:
//   24 bits  temperature in steps of 1/2048 K; 0: not a number or not above 0 K
//   13 bits  cosine of the sun's incidence times the visible share of the sun
//    1 bit   1: the surface belongs to an entity
//   12 bits  share of the hemisphere that shows sky
//   14 bits  material
#define EMIT_TEXEL_STEPS_PER_K 2048.0
#define EMIT_TEXEL_LAST_STEP 16777215.0

// Texel of a surface. `sun_cosine` and `open_frac` are held in 0..1, the temperature in 0..8192 K.
uvec2 packed_surface_texel(float temperature_k, float sun_cosine, float open_frac, uint material, bool moves) {
  float steps = temperature_k * EMIT_TEXEL_STEPS_PER_K + 0.5;
  uint temperature = steps >= 1.0 ? uint(min(steps, EMIT_TEXEL_LAST_STEP)) : 0u;
  uvec2 shares = uvec2(clamp(vec2(sun_cosine, open_frac), 0.0, 1.0) * vec2(8191.0, 4095.0) + 0.5);
  uint sun = shares.x << 1 | (moves ? 1u : 0u);
  return uvec2(temperature << 8 | sun >> 6, sun << 26 | shares.y << 14 | material);
}

// Temperature in K; NaN where the texel holds none.
float texel_temperature_k(uvec2 texel) {
  uint steps = texel.x >> 8;
  return steps > 0u ? float(steps) / EMIT_TEXEL_STEPS_PER_K : uintBitsToFloat(0x7fc00000u);
}

// Cosine of the sun's incidence times the visible share of the sun, 0..1.
float texel_sun_cosine(uvec2 texel) { return float((texel.x & 255u) << 5 | texel.y >> 27) / 8191.0; }

// True when the surface belongs to an entity.
bool texel_moves(uvec2 texel) { return (texel.y >> 26 & 1u) != 0u; }

// Share of the hemisphere that shows sky, 0..1.
float texel_open_frac(uvec2 texel) { return float(texel.y >> 14 & 4095u) / 4095.0; }

// Number of the material.
uint texel_material(uvec2 texel) { return texel.y & uint(EMIT_MAX_MATERIALS - 1); }
