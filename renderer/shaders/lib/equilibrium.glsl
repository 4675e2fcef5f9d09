// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_EQUILIBRIUM
#define EMIT_LIB_EQUILIBRIUM

// Positive root of  emission T^4 + conductance T = source  (physics.md eq. 4), in kelvin.
// Twin of emit/physics/equilibrium.hpp; see there for accuracy. Sets `clamped` (never clears it)
// where an input lies below its guard and the result is that of the guard.
float equilibrium_k(float emission_w_m2_k4, float conductance_w_m2_k, float source_w_m2,
                    inout bool clamped) {
  const float min_emission_w_m2_k4 = 1e-20;
  const float min_source_w_m2 = 1e-9;
  // Written so that NaN counts too.
  clamped = clamped || !(emission_w_m2_k4 >= min_emission_w_m2_k4) ||
            !(source_w_m2 >= min_source_w_m2);
  float e = max(emission_w_m2_k4, min_emission_w_m2_k4);
  float a = max(source_w_m2, min_source_w_m2);
  float g = conductance_w_m2_k;

  float r = sqrt(sqrt(a / e));
  float k = g * r / a;
  // Beyond 1e6 radiation is below rounding and k^3 could overflow.
  const float c0 = 0.27628703;
  const float c1 = 0.36899182;
  const float c2 = 0.57870529;
  const float c3 = 0.32065439;
  float x = k > 1e6 ? 1.0 / k
                    : (1.0 + k * (c0 + k * c1)) / (1.0 + k * (c2 + k * (c3 + k * c1)));
  float f = x * x * x * x + k * x - 1.0;
  float f1 = 4.0 * x * x * x + k;
  x -= f * f1 / (f1 * f1 - 6.0 * x * x * f);

  float t = r * x;
  float t3 = t * t * t;
  return t - ((e * t3 + g) * t - a) / (4.0 * e * t3 + g);
}

#endif
