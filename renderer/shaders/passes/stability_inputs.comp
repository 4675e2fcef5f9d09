// SPDX-License-Identifier: Apache-2.0
// Shader of `emit bench stability`: the inputs that the device draws for a case in the domain EMIT_DOMAIN, as bits. The
// CPU compares them with its own.
#include "shared/stability_inputs.glsl.h"

layout(local_size_x = 64) in;
layout(std430, binding = 1) writeonly buffer Outputs { uint out_bits[]; };
layout(location = 0) uniform uint first_case;
layout(location = 1) uniform uint case_count;
layout(location = 2) uniform uint seed;

void main() {
  // Draw all inputs of the case and write their bits.
  uint row = gl_GlobalInvocationID.x;
  if (row >= case_count) return;
  uint index = first_case + row;
  SurfaceInput s = surface_input(seed, index, uint(EMIT_DOMAIN));
  out_bits[8u * row] = floatBitsToUint(s.conductivity_w_m_k);
  out_bits[8u * row + 1u] = floatBitsToUint(s.thickness_m);
  out_bits[8u * row + 2u] = floatBitsToUint(s.emissivity_frac);
  out_bits[8u * row + 3u] = floatBitsToUint(s.radiative_k);
  out_bits[8u * row + 4u] = floatBitsToUint(s.core_k);
  out_bits[8u * row + 5u] = floatBitsToUint(s.film_w_m2_k);
  out_bits[8u * row + 6u] = floatBitsToUint(temperature_input(seed, index, true));
  out_bits[8u * row + 7u] = floatBitsToUint(drive_offset_k(seed, index, index & 1023u));
}
