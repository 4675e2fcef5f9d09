// SPDX-License-Identifier: Apache-2.0
// Packs two floats into 32 bits, each with the exponent of a float32 and 8 bits of its mantissa, so that it is off by
// at most 0.4 %. Software rasterisers take an instruction or two for this, and dozens for half floats.
uint packed_short_floats(vec2 v) {
  uvec2 rounded = floatBitsToUint(v) + 0x8000u;
  return (rounded.x & 0xffff0000u) | rounded.y >> 16;
}

vec2 short_floats(uint code) { return uintBitsToFloat(uvec2(code & 0xffff0000u, code << 16)); }
