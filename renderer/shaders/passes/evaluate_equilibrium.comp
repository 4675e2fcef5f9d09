// SPDX-License-Identifier: Apache-2.0
// Shader of `emit evaluate equilibrium`. Input row: lambda, d, eps, Ta, Tc, hc, Tair. Output row: Ts, source.
#include "lib/balance.glsl"
#include "lib/equilibrium.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Inputs { float in_row[]; };
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(location = 0) uniform uint row_count;

void main() {
  // Set up the balance of the row and solve it.
  uint row = gl_GlobalInvocationID.x;
  if (row >= row_count) return;
  uint i = row * 7u;
  float emissivity_frac = in_row[i + 2u];
  vec3 balance = surface_balance(environment_input_w_m2(emissivity_frac, in_row[i + 3u]),
                                 emissivity_frac, in_row[i] / in_row[i + 1u], in_row[i + 4u],
                                 in_row[i + 5u], in_row[i + 6u]);
  bool clamped = false;
  out_row[row * 2u] = equilibrium_k(balance.x, balance.y, balance.z, clamped);
  out_row[row * 2u + 1u] = balance.z;
}
