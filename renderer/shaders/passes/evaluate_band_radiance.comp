// SPDX-License-Identifier: Apache-2.0
// Shader of `emit evaluate band-radiance`. Input row: a temperature in K. Output row: in-band radiance of four bands in
// W m-2 sr-1. The constants are four layouts of four floats each, then the tables that they describe.
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Inputs { float in_row[]; };
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(std430, binding = 2) readonly buffer Constants { float band_lut[]; };
layout(location = 0) uniform uint row_count;

#define EMIT_PLANCK_LUT(index) band_lut[index]
#include "lib/planck_lut.glsl"

void main() {
  // Evaluate the table of each band.
  uint row = gl_GlobalInvocationID.x;
  if (row >= row_count) return;
  bool clamped = false;
  for (uint band = 0u; band < 4u; ++band) {
    vec4 layout_lut = vec4(band_lut[4u * band], band_lut[4u * band + 1u], band_lut[4u * band + 2u],
                           band_lut[4u * band + 3u]);
    out_row[4u * row + band] = planck_lut_radiance_w_m2_sr(in_row[row], layout_lut, clamped);
  }
}
