// SPDX-License-Identifier: Apache-2.0
// Shader of `emit bench stability`: in-band radiance at random temperatures. A case draws its temperature from its
// number. Output row: radiance in W m-2 sr-1, 1 if clamped. The constants are the table of the band.
#include "shared/stability_inputs.glsl.h"

layout(local_size_x = 64) in;
layout(std430, binding = 1) writeonly buffer Outputs { float out_row[]; };
layout(std430, binding = 2) readonly buffer Constants { float band_lut[]; };
layout(location = 0) uniform uint first_case;
layout(location = 1) uniform uint case_count;
layout(location = 2) uniform uint seed;
layout(location = 3) uniform vec4 layout_lut;

#define EMIT_PLANCK_LUT(index) band_lut[index]
#include "lib/planck_lut.glsl"

void main() {
  // Draw the temperature of the case and evaluate the table.
  uint row = gl_GlobalInvocationID.x;
  if (row >= case_count) return;
  bool clamped = false;
  float temperature_k = temperature_input(seed, first_case + row, EMIT_HOSTILE != 0);
  out_row[2u * row] = planck_lut_radiance_w_m2_sr(temperature_k, layout_lut, clamped);
  out_row[2u * row + 1u] = clamped ? 1.0 : 0.0;
}
