// SPDX-License-Identifier: Apache-2.0
// Packs what a pixel shows of a sampled surface into 64 bits, because software rasterisers take longer for every byte
// of a texel. The fields from the highest bit on are:
//   23 bits  temperature in steps of 1/2048 K, above 3584 K of 1/512 K; 0: not a number or not above 0 K
//   15 bits  cosine of the sun's incidence times the visible share of the sun
//    1 bit   1: the surface belongs to an entity
//   13 bits  share of the hemisphere that shows sky
//   12 bits  material
// One step of a share is 3e-5 of the sun or 1.2e-4 of the sky, so that a value that rounds to the other side on another
// device changes a surface of emissivity 0.7 by less than 1 mK in 3-5 um.
#define EMIT_TEXEL_STEPS_PER_K 2048.0
#define EMIT_TEXEL_COARSE_STEP 7340032.0  // of 3584 K; there are four steps of the fine kind in one of the coarse
#define EMIT_TEXEL_LAST_STEP 8388607.0

// Texel of a surface. `sun_cosine` and `open_frac` are held in 0..1, the temperature in 0..5632 K.
uvec2 packed_surface_texel(float temperature_k, float sun_cosine, float open_frac, uint material, bool moves) {
  float fine = temperature_k * EMIT_TEXEL_STEPS_PER_K;
  float steps = (fine > EMIT_TEXEL_COARSE_STEP ? mix(EMIT_TEXEL_COARSE_STEP, fine, 0.25) : fine) + 0.5;
  uint temperature = steps >= 1.0 ? uint(min(steps, EMIT_TEXEL_LAST_STEP)) : 0u;
  uvec2 shares = uvec2(clamp(vec2(sun_cosine, open_frac), 0.0, 1.0) * vec2(32767.0, 8191.0) + 0.5);
  uint sun = shares.x << 1 | (moves ? 1u : 0u);
  return uvec2(temperature << 9 | sun >> 7, sun << 25 | shares.y << 12 | material);
}

// Temperature in K; NaN where the texel holds none.
float texel_temperature_k(uvec2 texel) {
  uint code = texel.x >> 9;
  float steps = float(code);
  if (steps > EMIT_TEXEL_COARSE_STEP) steps = mix(EMIT_TEXEL_COARSE_STEP, steps, 4.0);
  return code > 0u ? steps / EMIT_TEXEL_STEPS_PER_K : uintBitsToFloat(0x7fc00000u);
}

// Cosine of the sun's incidence times the visible share of the sun, 0..1.
float texel_sun_cosine(uvec2 texel) { return float((texel.x & 511u) << 6 | texel.y >> 26) / 32767.0; }

// True when the surface belongs to an entity.
bool texel_moves(uvec2 texel) { return (texel.y >> 25 & 1u) != 0u; }

// Share of the hemisphere that shows sky, 0..1.
float texel_open_frac(uvec2 texel) { return float(texel.y >> 12 & 8191u) / 8191.0; }

// Number of the material.
uint texel_material(uvec2 texel) { return texel.y & uint(EMIT_MAX_MATERIALS - 1); }
