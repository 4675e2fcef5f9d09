// SPDX-License-Identifier: Apache-2.0
// Shader of `emit evaluate relaxation`. Input row: first interval, number of intervals, 1 for a linear drive, then
// weight and start offset of three modes. Output row: offset of the temperature in K. The constants hold for each
// interval the drive offset at both ends, then the gains (start, end) of three modes, which the CPU computes in double.
#include "lib/relaxation.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Inputs { float in_row[]; };
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(std430, binding = 2) readonly buffer Constants { float interval[]; };
layout(location = 0) uniform uint row_count;

void main() {
  // Read the row.
  uint row = gl_GlobalInvocationID.x;
  if (row >= row_count) return;
  uint i = row * 9u;
  uint first = uint(in_row[i]);
  uint count = uint(in_row[i + 1u]);
  bool is_linear = in_row[i + 2u] != 0.0;
  // Step all modes in one loop, because software rasterisers leave the loops of an invocation after 65535 turns.
  vec3 x = vec3(in_row[i + 4u], in_row[i + 6u], in_row[i + 8u]);
  for (uint step = 0u; step < count; ++step) {
    uint at = (first + step) * 8u;
    float u0 = interval[at];
    float u1 = interval[at + 1u];
    vec2 gains0 = vec2(interval[at + 2u], interval[at + 3u]);
    vec2 gains1 = vec2(interval[at + 4u], interval[at + 5u]);
    vec2 gains2 = vec2(interval[at + 6u], interval[at + 7u]);
    x = is_linear ? vec3(relax_linear(x.x, u0, u1, gains0), relax_linear(x.y, u0, u1, gains1),
                         relax_linear(x.z, u0, u1, gains2))
                  : vec3(relax_constant(x.x, u0, gains0), relax_constant(x.y, u0, gains1),
                         relax_constant(x.z, u0, gains2));
  }
  // Add up the weighted modes.
  out_row[row] = in_row[i + 3u] * x.x + in_row[i + 5u] * x.y + in_row[i + 7u] * x.z;
}
