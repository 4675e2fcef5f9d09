// SPDX-License-Identifier: Apache-2.0
// Fragment shader of the geometry pass. It writes what later passes need of the visible surface.
#include "shared/frame_params.glsl.h"
#include "passes/octahedral.glsl"
#include "passes/surface_texel.glsl"

layout(std140, binding = EMIT_BIND_DRAW) uniform Draw { DrawParams draw; };

#ifdef EMIT_CACHED
in vec4 sample_state;
in EMIT_BANDS_VEC incoming_w_m2_sr;
layout(location = 0) out uvec2 surface;
layout(location = 1) out EMIT_BANDS_VEC incoming;
#ifdef EMIT_OBJECTS
layout(location = 2) out uint object;
#endif
#ifdef EMIT_NORMAL
in vec3 normal_relworld;
layout(location = EMIT_NORMAL) out vec2 normal_octahedral;
#endif

void main() {
  // Turn the cosine of the sun to the side that faces the camera, and pack what the pixel shows.
  float cosine = gl_FrontFacing ? sample_state.w : -sample_state.w;
  surface = packed_surface_texel(sample_state.x, sample_state.y * max(cosine, 0.0), sample_state.z, draw.material,
                                 draw.moves != 0u);
  incoming = incoming_w_m2_sr;
#ifdef EMIT_OBJECTS
  object = draw.object;
#endif
#ifdef EMIT_NORMAL
  vec3 n = normalize(normal_relworld);
  normal_octahedral = octahedral_from_unit(gl_FrontFacing ? n : -n);
#endif
}
#else
in vec3 normal_relworld;
layout(location = 0) out float depth_m;
layout(location = 1) out vec2 normal_octahedral;
layout(location = 2) out uvec2 material_and_object;

void main() {
  // Take the distance along the boresight from clip w.
  depth_m = 1.0 / gl_FragCoord.w;
  // Turn the normal to the side that faces the camera.
  vec3 n = normalize(normal_relworld);
  normal_octahedral = octahedral_from_unit(gl_FrontFacing ? n : -n);
  material_and_object = uvec2(draw.material, draw.object);
}
#endif
