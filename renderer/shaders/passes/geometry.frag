// SPDX-License-Identifier: Apache-2.0
#include "passes/octahedral.glsl"

in vec3 normal_relworld;
flat in uvec2 ids;

layout(location = 0) out float depth_m;
layout(location = 1) out vec2 normal_octahedral;
layout(location = 2) out uvec2 material_and_object;

#ifdef EMIT_CACHED
in vec3 sample_state;
layout(location = 3) out vec4 state;
#endif

void main() {
  depth_m = 1.0 / gl_FragCoord.w;  // clip w is the distance along the boresight
  vec3 n = normalize(normal_relworld);
  normal_octahedral = octahedral_from_unit(gl_FrontFacing ? n : -n);
  material_and_object = ids;
#ifdef EMIT_CACHED
  state = vec4(sample_state, 0.0);
#endif
}
