// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_RELAXATION
#define EMIT_LIB_RELAXATION

// Exact steps of tau x' = u - x (physics.md eq. 6). Twin of emit/physics/relaxation.hpp, which computes the gains
// (start, end) in double on the CPU. `x` and `u` are offsets from a reference temperature, in K.

// State after a step whose drive goes linearly from u0 to u1.
float relax_linear(float x, float u0, float u1, vec2 gains_frac) {
  return x + ((u0 - x) * gains_frac.x + (u1 - x) * gains_frac.y);
}

// State after a step with the constant drive u.
float relax_constant(float x, float u, vec2 gains_frac) {
  return x + (u - x) * (gains_frac.x + gains_frac.y);
}

#endif
