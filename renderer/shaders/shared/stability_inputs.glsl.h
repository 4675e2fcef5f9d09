// SPDX-License-Identifier: Apache-2.0
// Random inputs of the stability sweeps. C++ and GLSL make them by the same integer arithmetic: the device draws a case
// from its number, and the CPU draws the same bits again to check the result.
#pragma once
#ifdef __cplusplus
#include <bit>
#include <cstdint>
#include <emit/physics/check.hpp>  // in angle brackets, because the shader loader follows quotes
#define EMIT_STABILITY_BEGIN                                                    \
  namespace emit::verify::inputs {                                            \
  using uint = std::uint32_t;                                                   \
  inline float uintBitsToFloat(uint bits) { return std::bit_cast<float>(bits); } \
  inline uint floatBitsToUint(float value) { return std::bit_cast<uint>(value); }
#define EMIT_STABILITY_END }
#define EMIT_STABILITY_FUNCTION inline
#define EMIT_STABILITY_CHECK(condition) EMIT_DCHECK(condition)
#else
#define EMIT_STABILITY_BEGIN
#define EMIT_STABILITY_END
#define EMIT_STABILITY_FUNCTION
#define EMIT_STABILITY_CHECK(condition)
#endif

// Domains of the surface inputs.
#define EMIT_DOMAIN_BOX 0       // the ranges that the solver is specified for
#define EMIT_DOMAIN_EXTENDED 1  // temperatures to 6000 K, film coefficient to 120 W m-2 K-1
#define EMIT_DOMAIN_HOSTILE 2   // about half of the values are nonsense
#define EMIT_DOMAIN_RAW 3       // coefficients of the quartic: every bit pattern float32 has

EMIT_STABILITY_BEGIN

// One random surface.
struct SurfaceInput {
  float conductivity_w_m_k;
  float thickness_m;
  float emissivity_frac;
  float radiative_k;  // temperature at which emission alone balances the absorbed flux
  float core_k;
  float film_w_m2_k;
  float air_k;
};

// Finaliser of MurmurHash3. Every output bit depends on every input bit.
EMIT_STABILITY_FUNCTION uint mixed_bits(uint x) {
  x ^= x >> 16u;
  x *= 0x85EBCA6Bu;
  x ^= x >> 13u;
  x *= 0xC2B2AE35u;
  x ^= x >> 16u;
  return x;
}

// 32 random bits for one dimension of one case.
EMIT_STABILITY_FUNCTION uint random_bits(uint seed, uint index, uint dimension) {
  return mixed_bits(mixed_bits(index * 0x9E3779B9u + seed) + dimension * 0x7FEB352Du + 0x2545F491u);
}

// High word of the 64-bit product bits * n. It is uniform in 0..n-1.
EMIT_STABILITY_FUNCTION uint high_product(uint bits, uint n) {
  uint low = bits & 0xFFFFu;
  uint high = bits >> 16u;
  uint n_low = n & 0xFFFFu;
  uint n_high = n >> 16u;
  uint middle = high * n_low + ((low * n_low) >> 16u);
  uint rest = low * n_high + (middle & 0xFFFFu);
  return high * n_high + (middle >> 16u) + (rest >> 16u);
}

// True for one value in four, which is to lie on an edge of its range. Bits 0..2 decide.
EMIT_STABILITY_FUNCTION bool on_edge(uint bits) { return (bits & 7u) < 2u; }

// Random number that is uniform over the float32 numbers of [lo, hi], that is, logarithmic.
// @pre 0 < lo < hi
EMIT_STABILITY_FUNCTION float logarithmic_between(uint bits, float lo, float hi) {
  EMIT_STABILITY_CHECK(0.0f < lo && lo < hi);
  if (on_edge(bits)) return (bits & 7u) == 0u ? lo : hi;
  uint first = floatBitsToUint(lo);
  return uintBitsToFloat(first + high_product(bits, floatBitsToUint(hi) - first + 1u));
}

// Random number that is uniform over the multiples of 1/2048 in [lo, hi].
// @pre lo < hi <= 8191, so that every multiple is exact in float32
EMIT_STABILITY_FUNCTION float linear_between(uint bits, uint lo, uint hi) {
  EMIT_STABILITY_CHECK(lo < hi && hi <= 8191u);
  if (on_edge(bits)) return float((bits & 7u) == 0u ? lo : hi);
  return float(lo * 2048u + high_product(bits, (hi - lo) * 2048u + 1u)) * (1.0f / 2048.0f);
}

// Value that a damaged file, a bad message or a defect might pass. One in sixteen is the bit pattern `any`.
EMIT_STABILITY_FUNCTION float hostile_value(uint bits, uint any) {
  switch (bits & 15u) {
    case 0u: return 0.0f;
    case 1u: return uintBitsToFloat(0x80000000u);  // -0
    case 2u: return -1.0f;
    case 3u: return uintBitsToFloat(1u);  // smallest denormal
    case 4u: return uintBitsToFloat(0x00800000u);  // smallest normal
    case 5u: return 1e-20f;
    case 6u: return 1e-9f;
    case 7u: return 1.0f;
    case 8u: return 6000.0f;
    case 9u: return 1e12f;
    case 10u: return 1e30f;
    case 11u: return uintBitsToFloat(0x7F7FFFFFu);  // largest
    case 12u: return uintBitsToFloat(0xFF7FFFFFu);
    case 13u: return uintBitsToFloat((bits & 16u) == 0u ? 0x7F800000u : 0xFF800000u);  // +-Inf
    case 14u: return uintBitsToFloat(0x7FC00000u);  // NaN
    default: return uintBitsToFloat(any);
  }
}

// Replaces about half of the values by hostile ones.
EMIT_STABILITY_FUNCTION float hostile_or(float value, uint seed, uint index, uint dimension) {
  uint bits = random_bits(seed, index, dimension + 16u);
  if ((bits & 0x80000000u) == 0u) return value;
  return hostile_value(bits, random_bits(seed, index, dimension + 32u));
}

// Random surface of case `index` in a domain (EMIT_DOMAIN_*).
EMIT_STABILITY_FUNCTION SurfaceInput surface_input(uint seed, uint index, uint domain) {
  bool box = domain == uint(EMIT_DOMAIN_BOX);
  SurfaceInput s;
  s.conductivity_w_m_k = logarithmic_between(random_bits(seed, index, 0u), 0.02f, 400.0f);
  s.thickness_m = logarithmic_between(random_bits(seed, index, 1u), 1e-4f, 1.0f);
  s.emissivity_frac = logarithmic_between(random_bits(seed, index, 2u), 0.02f, 1.0f);
  s.radiative_k = linear_between(random_bits(seed, index, 3u), 0u, box ? 1000u : 6000u);
  s.core_k = linear_between(random_bits(seed, index, 4u), box ? 200u : 0u, box ? 400u : 6000u);
  s.film_w_m2_k = box ? 0.0f : linear_between(random_bits(seed, index, 5u), 0u, 120u);
  s.air_k = box ? 0.0f : linear_between(random_bits(seed, index, 6u), 200u, 400u);
  if (domain == uint(EMIT_DOMAIN_HOSTILE)) {
    s.conductivity_w_m_k = hostile_or(s.conductivity_w_m_k, seed, index, 0u);
    s.thickness_m = hostile_or(s.thickness_m, seed, index, 1u);
    s.emissivity_frac = hostile_or(s.emissivity_frac, seed, index, 2u);
    s.radiative_k = hostile_or(s.radiative_k, seed, index, 3u);
    s.core_k = hostile_or(s.core_k, seed, index, 4u);
    s.film_w_m2_k = hostile_or(s.film_w_m2_k, seed, index, 5u);
    s.air_k = hostile_or(s.air_k, seed, index, 6u);
  }
  return s;
}

// Coefficient `dimension` (0 emission, 1 conductance, 2 source) of a case of EMIT_DOMAIN_RAW.
EMIT_STABILITY_FUNCTION float raw_coefficient(uint seed, uint index, uint dimension) {
  uint any = random_bits(seed, index, dimension);
  uint bits = random_bits(seed, index, dimension + 16u);
  return (bits & 0x40000000u) == 0u ? uintBitsToFloat(any) : hostile_value(bits, any);
}

// Temperature in K for the radiance tables. With `hostile` one in four is hostile; all others lie in 0..6000 K.
EMIT_STABILITY_FUNCTION float temperature_input(uint seed, uint index, bool hostile) {
  uint bits = random_bits(seed, index, 0u);
  uint kind = random_bits(seed, index, 1u);
  if (hostile && (kind & 3u) == 0u) return hostile_value(bits, random_bits(seed, index, 2u));
  // Draw half of them logarithmically, so that the cold end is covered.
  return (kind & 4u) == 0u ? linear_between(bits, 0u, 6000u)
                           : logarithmic_between(bits, 0.001f, 6000.0f);
}

// Drive at a node of a relaxation case: an offset of -128..128 K, a multiple of 2^-14 K.
EMIT_STABILITY_FUNCTION float drive_offset_k(uint seed, uint index, uint node) {
  return float(high_product(random_bits(seed, index, node + 64u), 4194305u)) * (1.0f / 16384.0f) - 128.0f;
}

EMIT_STABILITY_END
