// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_EQUILIBRIUM
#define EMIT_LIB_EQUILIBRIUM

// `value` held in [low, high]; NaN becomes `low`. Sets `clamped` where the value changes. NaN is found by its bits,
// because a compiler may assume that there is none and turn !(x >= y) into x < y.
float held_in_range(float value, float low, float high, inout bool clamped) {
  bool is_number = (floatBitsToUint(value) & 0x7fffffffu) <= 0x7f800000u;
  float held = is_number ? clamp(value, low, high) : low;
  clamped = clamped || !is_number || held != value;
  return held;
}

// Positive root of  emission T^4 + conductance T = source  (physics.md eq. 4), in kelvin. Twin of
// emit/physics/equilibrium.hpp, which states the accuracy. The result is finite for every input: inputs are held in
// their ranges, which sets `clamped` (never clears it). The ranges keep every intermediate result within float32.
float equilibrium_k(float emission_w_m2_k4, float conductance_w_m2_k, float source_w_m2,
                    inout bool clamped) {
  float e = held_in_range(emission_w_m2_k4, 1e-20, 1.0, clamped);
  float a = held_in_range(source_w_m2, 1e-9, 1e18, clamped);
  float g = held_in_range(conductance_w_m2_k, 0.0, 1e16, clamped);

  // Scale the quartic: x = T / r solves x^4 + k x = 1.
  float r = sqrt(sqrt(a / e));
  float k = g * r / a;
  // Start from a rational estimate. Beyond k = 1e6 radiation is below rounding and k^3 could overflow.
  const float c0 = 0.27628703;
  const float c1 = 0.36899182;
  const float c2 = 0.57870529;
  const float c3 = 0.32065439;
  float x = k > 1e6 ? 1.0 / k
                    : (1.0 + k * (c0 + k * c1)) / (1.0 + k * (c2 + k * (c3 + k * c1)));
  // Improve x by one step of Halley's method.
  float f = x * x * x * x + k * x - 1.0;
  float f1 = 4.0 * x * x * x + k;
  x -= f * f1 / (f1 * f1 - 6.0 * x * x * f);

  // Polish the temperature by one Newton step on the unscaled quartic.
  float t = r * x;
  float t3 = t * t * t;
  return t - ((e * t3 + g) * t - a) / (4.0 * e * t3 + g);
}

#endif
