// SPDX-License-Identifier: Apache-2.0
// `emit evaluate relaxation`: rows (first interval, intervals, kind, 3 x (weight, start offset)) ->
// offset of the temperature. Constants: per interval the drive offset at both ends, then the gains
// (start, end) of three modes, computed in double by the CPU.
#include "lib/relaxation.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Inputs { float in_row[]; };
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(std430, binding = 2) readonly buffer Constants { float interval[]; };
layout(location = 0) uniform uint row_count;

void main() {
  uint row = gl_GlobalInvocationID.x;
  if (row >= row_count) return;
  uint i = row * 9u;
  uint first = uint(in_row[i]);
  uint count = uint(in_row[i + 1u]);
  bool is_linear = in_row[i + 2u] != 0.0;
  float sum_k = 0.0;
  for (uint mode = 0u; mode < 3u; ++mode) {
    float x = in_row[i + 4u + 2u * mode];
    for (uint step = 0u; step < count; ++step) {
      uint at = (first + step) * 8u;
      vec2 gains_frac = vec2(interval[at + 2u + 2u * mode], interval[at + 3u + 2u * mode]);
      x = is_linear ? relax_linear(x, interval[at], interval[at + 1u], gains_frac)
                    : relax_constant(x, interval[at], gains_frac);
    }
    sum_k += in_row[i + 3u + 2u * mode] * x;
  }
  out_row[row] = sum_k;
}
