// SPDX-License-Identifier: Apache-2.0
// Shader of `emit bench stability`: many relaxation steps per case. A dispatch does some of them, because Mesa's
// software rasteriser leaves the loops of an invocation after 65535 turns without an error. The constants hold for each
// case the number of steps (as an exact float), 1 for a linear drive, the start offset in K, and the gains (start, end)
// of four step lengths that take turns. The drive is drawn from the numbers of case and node.
#include "lib/relaxation.glsl"
#include "shared/stability_inputs.glsl.h"

layout(local_size_x = 64) in;
layout(std430, binding = 1) buffer Outputs { float out_row[]; };
layout(std430, binding = 2) readonly buffer Constants { float case_row[]; };
layout(location = 0) uniform uint first_case;
layout(location = 1) uniform uint case_count;
layout(location = 2) uniform uint seed;
layout(location = 4) uniform uint first_step;
layout(location = 5) uniform uint last_step;  // one past the last step of the dispatch

void main() {
  // Read the case and the state that the previous dispatch left.
  uint row = gl_GlobalInvocationID.x;
  if (row >= case_count) return;
  uint index = first_case + row;
  uint at = 11u * row;
  uint end = min(uint(case_row[at]), last_step);
  bool is_linear = case_row[at + 1u] != 0.0;
  float x = first_step == 0u ? case_row[at + 2u] : out_row[row];
  float u0 = drive_offset_k(seed, index, first_step);
  // Step with drives drawn on the way.
  for (uint step = first_step; step < end; ++step) {
    uint gains = at + 3u + 2u * (step & 3u);
    vec2 gains_frac = vec2(case_row[gains], case_row[gains + 1u]);
    float u1 = drive_offset_k(seed, index, step + 1u);
    x = is_linear ? relax_linear(x, u0, u1, gains_frac) : relax_constant(x, u0, gains_frac);
    u0 = u1;
  }
  out_row[row] = x;
}
