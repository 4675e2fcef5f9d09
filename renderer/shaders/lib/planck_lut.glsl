// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_PLANCK_LUT
#define EMIT_LIB_PLANCK_LUT

// Band radiance of a blackbody from a table of T ln L over T (physics.md eq. 8). emit/physics/band_radiance_lut.hpp
// builds the table. The including shader defines EMIT_PLANCK_LUT(index), the float at that index of its buffer, and
// passes the layout that the C++ side computed:
//   layout.x  temperature of the first node, K
//   layout.y  nodes per kelvin
//   layout.z  number of nodes - 1
//   layout.w  index of the first node in the buffer
// The function interpolates itself, because texture filters keep only 8 bits of the fraction.

// Band radiance of a blackbody in W m-2 sr-1. Outside the table its nearest end is used and `clamped` is set (never
// cleared). NaN counts as below the table.
float planck_lut_radiance_w_m2_sr(float temperature_k, vec4 layout_lut, inout bool clamped) {
  float wanted = (temperature_k - layout_lut.x) * layout_lut.y;
  float place = wanted >= 0.0 ? min(wanted, layout_lut.z) : 0.0;
  bool inside = place == wanted;
  clamped = clamped || !inside;
  float t = inside ? temperature_k : layout_lut.x + place / layout_lut.y;
  float node = min(floor(place), layout_lut.z - 1.0);
  int first = int(layout_lut.w) + int(node);
  float y = mix(EMIT_PLANCK_LUT(first), EMIT_PLANCK_LUT(first + 1), place - node);
  return exp(y / t);
}

#endif
