// SPDX-License-Identifier: Apache-2.0
// What a pixel shows of a sampled surface, in 64 bits: software rasterisers take longer for every byte of a
// texel. From the highest bit: temperature in 1/2048 K, 24 bits, 0: not a number or not above 0 K; cosine of
// the sun's incidence times its visible share, 13; 1 if it is an entity's; open share of the hemisphere, 12;
// material, 14.
#define EMIT_TEXEL_STEPS_PER_K 2048.0
#define EMIT_TEXEL_LAST_STEP 16777215.0

uvec2 packed_surface_texel(float temperature_k, float sun_cosine, float open_frac, uint material, bool moves) {
  float steps = temperature_k * EMIT_TEXEL_STEPS_PER_K + 0.5;
  uint temperature = steps >= 1.0 ? uint(min(steps, EMIT_TEXEL_LAST_STEP)) : 0u;
  uvec2 shares = uvec2(clamp(vec2(sun_cosine, open_frac), 0.0, 1.0) * vec2(8191.0, 4095.0) + 0.5);
  uint sun = shares.x << 1 | (moves ? 1u : 0u);
  return uvec2(temperature << 8 | sun >> 6, sun << 26 | shares.y << 14 | material);
}

float texel_temperature_k(uvec2 texel) {
  uint steps = texel.x >> 8;
  return steps > 0u ? float(steps) / EMIT_TEXEL_STEPS_PER_K : uintBitsToFloat(0x7fc00000u);
}

float texel_sun_cosine(uvec2 texel) { return float((texel.x & 255u) << 5 | texel.y >> 27) / 8191.0; }

bool texel_moves(uvec2 texel) { return (texel.y >> 26 & 1u) != 0u; }

float texel_open_frac(uvec2 texel) { return float(texel.y >> 14 & 4095u) / 4095.0; }

uint texel_material(uvec2 texel) { return texel.y & uint(EMIT_MAX_MATERIALS - 1); }
