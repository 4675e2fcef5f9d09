// SPDX-License-Identifier: Apache-2.0
// Shader of `emit bench stability`: equilibrium temperatures of random surfaces. A case draws its surface from its
// number in the domain EMIT_DOMAIN. Output row: temperature in K, 1 if clamped. With EMIT_CLOSED_FORMS the row also
// holds EMIT Eq. 6 as typeset, EMIT Eq. 6 with its outer root closed where the derivation closes it, and an equivalent
// form that does not cancel.
#include "lib/balance.glsl"
#include "lib/equilibrium.glsl"
#include "shared/stability_inputs.glsl.h"

layout(local_size_x = 64) in;
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(location = 0) uniform uint first_case;
layout(location = 1) uniform uint case_count;
layout(location = 2) uniform uint seed;

#ifdef EMIT_CLOSED_FORMS
const uint kStride = 5u;

float cube_root(float x) { return pow(x, 1.0 / 3.0); }

// Three closed forms of the temperature in K: as typeset, corrected, without cancellation.
vec3 closed_forms(SurfaceInput s) {
  float b = s.thickness_m * EMIT_STEFAN_BOLTZMANN_W_M2_K4 * s.emissivity_frac / s.conductivity_w_m_k;
  float t_b = 1.0 / cube_root(b);
  float theta_c = s.core_k / t_b;
  float theta_a = s.radiative_k / t_b;
  float theta_a4 = theta_a * theta_a * theta_a * theta_a;
  float q = theta_c + theta_a4;
  float n = sqrt(256.0 * q * q * q + 27.0);
  float k = cube_root(n / (2.0 * 5.19615242) + 0.5);  // 3^(3/2)
  float root = sqrt(3.0 * k * k - 4.0 * theta_c - 4.0 * theta_a4);
  float head = 2.0 * sqrt(3.0 * k) / root - k + (4.0 * theta_c + 4.0 * theta_a4) / (3.0 * k);
  float tail = root / sqrt(3.0 * k);

  float p = 4.0 * q / 3.0;
  float c = cube_root(0.5 + sqrt(0.25 + p * p * p));
  float u = 1.0 / (c * c + p + (p / c) * (p / c));
  float r = sqrt(u);
  float theta = 4.0 * q * r / ((1.0 + u * r) * (sqrt(2.0 / r - u) + r));
  return vec3(t_b / 2.0 * sqrt(head - tail), t_b / 2.0 * (sqrt(head) - tail), t_b * theta);
}
#else
const uint kStride = 2u;
#endif

void main() {
  // Draw the surface of the case.
  uint row = gl_GlobalInvocationID.x;
  if (row >= case_count) return;
  uint index = first_case + row;
  bool clamped = false;
#if EMIT_DOMAIN == EMIT_DOMAIN_RAW
  vec3 balance = vec3(raw_coefficient(seed, index, 0u), raw_coefficient(seed, index, 1u),
                      raw_coefficient(seed, index, 2u));
#else
  SurfaceInput s = surface_input(seed, index, uint(EMIT_DOMAIN));
  vec3 balance = surface_balance(environment_input_w_m2(s.emissivity_frac, s.radiative_k),
                                 s.emissivity_frac, s.conductivity_w_m_k / s.thickness_m, s.core_k,
                                 s.film_w_m2_k, s.air_k);
#endif
  // Solve its balance.
  out_row[kStride * row] = equilibrium_k(balance.x, balance.y, balance.z, clamped);
  out_row[kStride * row + 1u] = clamped ? 1.0 : 0.0;
#ifdef EMIT_CLOSED_FORMS
  vec3 forms = closed_forms(s);
  out_row[kStride * row + 2u] = forms.x;
  out_row[kStride * row + 3u] = forms.y;
  out_row[kStride * row + 4u] = forms.z;
#endif
}
