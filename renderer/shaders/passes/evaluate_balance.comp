// SPDX-License-Identifier: Apache-2.0
// Shader of `emit evaluate balance`.
// Input row: S_d, S_i, R_e, R_LW, absorptance, beta, f_d, f_i, eps, lambda, d, Tc, hc, Tair.
// Output row: E_abs, Ta, source, Ts, source with convection, Ts with convection.
#include "lib/balance.glsl"
#include "lib/equilibrium.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Inputs { float in_row[]; };
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(location = 0) uniform uint row_count;

void main() {
  // Compute the absorbed flux of the row.
  uint row = gl_GlobalInvocationID.x;
  if (row >= row_count) return;
  uint i = row * 14u;
  float emissivity_frac = in_row[i + 8u];
  float absorbed_w_m2 =
      absorbed_flux_w_m2(in_row[i], in_row[i + 1u], in_row[i + 2u], in_row[i + 3u], in_row[i + 5u],
                         in_row[i + 6u], in_row[i + 7u], in_row[i + 4u], emissivity_frac);
  float conductance_w_m2_k = in_row[i + 9u] / in_row[i + 10u];
  float core_k = in_row[i + 11u];
  // Set up the balance without and with convection.
  vec3 plain = surface_balance(absorbed_w_m2, emissivity_frac, conductance_w_m2_k, core_k, 0.0,
                               0.0);
  vec3 film = surface_balance(absorbed_w_m2, emissivity_frac, conductance_w_m2_k, core_k,
                              in_row[i + 12u], in_row[i + 13u]);
  // Write the results.
  bool clamped = false;
  uint o = row * 6u;
  out_row[o] = absorbed_w_m2;
  out_row[o + 1u] = radiative_temperature_k(absorbed_w_m2, emissivity_frac);
  out_row[o + 2u] = plain.z;
  out_row[o + 3u] = equilibrium_k(plain.x, plain.y, plain.z, clamped);
  out_row[o + 4u] = film.z;
  out_row[o + 5u] = equilibrium_k(film.x, film.y, film.z, clamped);
}
