// SPDX-License-Identifier: Apache-2.0
// Functions that read the material table and the relaxation table. Every pixel reads them at its own index.
layout(binding = EMIT_TEX_MATERIALS) uniform samplerBuffer material_table;     // MaterialParams
layout(binding = EMIT_TEX_RELAXATION) uniform samplerBuffer relaxation_table;  // RelaxationParams

// Surface of a material: solar absorptance, emissivity, conductance in W m-2 K-1, base temperature in K.
vec4 material_surface(int material) { return texelFetch(material_table, material * EMIT_MATERIAL_TEXELS); }

// Temperatures of a material: initial offset in K, prescribed offset in K, 1 if prescribed, base offset in K.
vec4 material_start(int material) { return texelFetch(material_table, material * EMIT_MATERIAL_TEXELS + 1); }

// Resistances of four modes of a material in m2 K W-1. `group` counts the modes by fours.
vec4 material_resistance_m2k_w(int material, int group) {
  return texelFetch(material_table, material * EMIT_MATERIAL_TEXELS + 2 + group);
}

// A material gives three numbers to the film of its faces: its roughness factor and two of its leaves.
vec3 material_skin(int material) {
  return vec3(texelFetch(material_table, material * EMIT_MATERIAL_TEXELS + 4).x,
              texelFetch(material_table, material * EMIT_MATERIAL_TEXELS + 5).xy);
}

// Water of a material: wetness (0: dry), resistance to evaporation in sunlight and without it in s/m.
vec3 material_water(int material) { return texelFetch(material_table, material * EMIT_MATERIAL_TEXELS + 4).yzw; }

// Mode 0 or 1 of emit2014: gain at the start, gain at the end, weight, 0.
vec4 relaxation_mode(int entry, int mode) { return texelFetch(relaxation_table, entry * 2 + mode); }

// First texel of the gains of foster for a split of an interval.
int foster_gains_at(int entry, int level) { return (entry + level * EMIT_FOSTER_TEXELS) * 2; }

// foster: share of a face that rain has wetted, at the start and the end of an interval. Rain falls straight down, and
// nothing above the face keeps it off. The table has ground with all of the rain, half of it, and none.
vec2 rain_wet_frac(int entry, float up) {
  int at = (entry + EMIT_FOSTER_ENTRIES - 1) * 2;
  vec3 begin = texelFetch(relaxation_table, at).xyz;
  vec3 end = texelFetch(relaxation_table, at + 1).xyz;
  float halves = 2.0 * clamp(up, 0.0, 1.0);
  return halves < 1.0 ? mix(vec2(begin.z, end.z), vec2(begin.y, end.y), halves)
                      : mix(vec2(begin.y, end.y), vec2(begin.x, end.x), halves - 1.0);
}
