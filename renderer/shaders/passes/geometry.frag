// SPDX-License-Identifier: Apache-2.0
// Fragment shader of the geometry pass. It writes what later passes need of the visible surface.
#include "shared/frame_params.glsl.h"
#include "passes/octahedral.glsl"
#include "passes/surface_texel.glsl"
#ifdef EMIT_CLUTTER
#include "passes/short_floats.glsl"
#endif

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
#ifdef EMIT_CLUTTER
in vec3 tile_position;
in vec2 clutter_k;
#ifdef EMIT_OBJECTS
layout(location = 3) out uvec4 clutter;
#else
layout(location = 2) out uvec4 clutter;
#endif

// Packs place in the field, slopes of the temperature and footprint of the pixel for passes/clutter.glsl.
uvec4 packed_clutter() {
  // Take the plane that the triangle faces most.
  vec3 across = dFdx(tile_position) * float(EMIT_CLUTTER_SIDE);
  vec3 down = dFdy(tile_position) * float(EMIT_CLUTTER_SIDE);
  vec3 facing = abs(cross(across, down));
  bool level = facing.z >= max(facing.x, facing.y);
  bool along = facing.x >= facing.y;
  vec2 place = level ? tile_position.xy : along ? tile_position.yz : tile_position.xz;
  vec2 a = level ? across.xy : along ? across.yz : across.xz;
  vec2 b = level ? down.xy : along ? down.yz : down.xz;
  // Take the axes of the pixel's footprint: the singular values of (a b), which a roll of the sensor does not change.
  float along_x = a.x * a.x + b.x * b.x;
  float along_y = a.y * a.y + b.y * b.y;
  float mixed = a.x * a.y + b.x * b.y;
  float apart = 0.5 * (along_x - along_y);
  float longer2 = max(0.5 * (along_x + along_y) + sqrt(apart * apart + mixed * mixed), 1e-20);
  vec2 axis = apart >= 0.0 ? vec2(longer2 - along_y, mixed) : vec2(mixed, longer2 - along_x);
  float axis2 = dot(axis, axis);
  vec2 longer = axis2 > 0.0 ? axis * sqrt(longer2 / axis2) : vec2(sqrt(longer2), 0.0);
  float width_frac = min(abs(a.x * b.y - a.y * b.x) / longer2, 1.0);
  // Convert to signed integers first: software rasterisers take an instruction for that, and several for unsigned ones.
  uvec2 steps = uvec2(ivec2(fract(place) * EMIT_CLUTTER_PLACE_STEPS)) << 8;
  return uvec4(steps.x | uint(int(width_frac * 255.0 + 0.5)), steps.y | draw.field,
               packed_short_floats(longer), packed_short_floats(clutter_k));
}
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
#ifdef EMIT_CLUTTER
  clutter = draw.field != 0u ? packed_clutter() : uvec4(0u);
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
