// SPDX-License-Identifier: Apache-2.0
#include "shared/frame_params.glsl.h"
#include "passes/octahedral.glsl"

layout(std140, binding = EMIT_BIND_DRAW) uniform Draw { DrawParams draw; };

#ifdef EMIT_CACHED
in vec4 sample_state;
// All that the radiance pass needs, so that it reads one texel (gbuffer.glsl unpacks it).
layout(location = 0) out uvec4 surface;

void main() {
  float boresight_m = 1.0 / gl_FragCoord.w;  // clip w is the distance along the boresight
  float cosine = gl_FrontFacing ? sample_state.w : -sample_state.w;
  surface = uvec4(floatBitsToUint(boresight_m), floatBitsToUint(sample_state.x),
                  packUnorm2x16(vec2(sample_state.y * max(cosine, 0.0), sample_state.z)),
                  draw.ids.y << 16 | draw.ids.x);
}
#else
in vec3 normal_relworld;
layout(location = 0) out float depth_m;
layout(location = 1) out vec2 normal_octahedral;
layout(location = 2) out uvec2 material_and_object;

void main() {
  depth_m = 1.0 / gl_FragCoord.w;  // clip w is the distance along the boresight
  vec3 n = normalize(normal_relworld);
  normal_octahedral = octahedral_from_unit(gl_FrontFacing ? n : -n);
  material_and_object = draw.ids.xy;
}
#endif
