// SPDX-License-Identifier: Apache-2.0
// Tables that every pixel reads at its own place.
layout(binding = EMIT_TEX_MATERIALS) uniform samplerBuffer material_table;      // MaterialParams
layout(binding = EMIT_TEX_RELAXATION) uniform samplerBuffer relaxation_table;  // RelaxationParams

// solar absorptance, emissivity, conductance in W m-2 K-1, base temperature in K
vec4 material_surface(int material) { return texelFetch(material_table, material * 3); }

// initial offset in K, prescribed offset in K, 1 if prescribed, base offset in K
vec4 material_start(int material) { return texelFetch(material_table, material * 3 + 1); }

vec4 material_resistance_m2k_w(int material) { return texelFetch(material_table, material * 3 + 2); }

// gains at the start and the end, weight
vec4 relaxation_mode(int entry, int mode) { return texelFetch(relaxation_table, entry * 2 + mode); }
