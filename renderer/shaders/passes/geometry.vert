// SPDX-License-Identifier: Apache-2.0
// Vertex shader of the geometry pass. With EMIT_CACHED a vertex is a thermal sample of the surface.
#include "shared/frame_params.glsl.h"

// A value that differs from vertex to vertex is an attribute; the rest is a uniform block. Software rasterisers fetch
// attributes much faster than texels, and uniforms not once per vertex.
layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_NORMAL) in vec4 normal_mesh;  // EMIT_CACHED: w = share of the sky

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(std140, binding = EMIT_BIND_DRAW) uniform Draw { DrawParams draw; };

#ifdef EMIT_CACHED
layout(std140, binding = EMIT_BIND_BANDS) uniform Bands { BandParams bands[EMIT_MAX_BANDS]; };
#define EMIT_SKY_TILT(band, node) bands[band].sky_by_tilt_w_m2_sr[(node) >> 2][(node) & 3]
#include "lib/sky_tilt.glsl"
#ifdef EMIT_SEEN
// Radiance that other samples send at the two nodes, by band, above that of the surroundings and times their share of
// the hemisphere.
layout(location = EMIT_ATTR_SEEN_BEFORE) in vec4 seen_before;
layout(location = EMIT_ATTR_SEEN_AFTER) in vec4 seen_after;
#endif
// Mean radiance that arrives from everything but the sun, by band, W m-2 sr-1.
out EMIT_BANDS_VEC incoming_w_m2_sr;
// State of the sample at the node of time before the frame and at the node after it: temperature offset and bow of the
// interval before the node in K, visible share of the sun.
layout(location = EMIT_ATTR_NODE_BEFORE) in vec3 node_before;
layout(location = EMIT_ATTR_NODE_AFTER) in vec3 node_after;
#ifdef EMIT_CLUTTER
// Temperature offsets of the twins of the sample at the same nodes, and bow at the node after the frame, in K.
layout(location = EMIT_ATTR_LOW_BEFORE) in float low_before;
layout(location = EMIT_ATTR_LOW_AFTER) in vec2 low_after;
layout(location = EMIT_ATTR_HIGH_BEFORE) in float high_before;
layout(location = EMIT_ATTR_HIGH_AFTER) in vec2 high_after;
// Place in the field, in tiles, and the change of the temperature in K per standard deviation and per its square.
out vec3 tile_position;
out vec2 clutter_k;
#endif
#ifdef EMIT_SHADE
// Temperature in K that recent shade of entities has taken off the sample in full sun. It is added back here, because
// passes/shade.comp subtracts the shade of each pixel.
layout(location = EMIT_ATTR_SHADE) in float shade_k;
// Opening of the own hull of an entity: half of its share of the hemisphere, and the part of the sky in it per component
// of the zenith in the body frame.
layout(location = EMIT_ATTR_HULL) in vec4 hull;
#endif
// Temperature in K, share of the sun, share of the sky, cosine of the sun's incidence on the front.
out vec4 sample_state;
#ifdef EMIT_NORMAL
out vec3 normal_relworld;
#endif
#else
out vec3 normal_relworld;
#endif

#ifdef EMIT_CACHED
// Returns the temperature offset of a sample between the nodes (physics.md eq. 85). `after` has its offset and its bow.
float offset_now_k(float before_k, vec2 after_k) {
  return mix(before_k, after_k.x, frame.node_frac) + frame.node_bow * after_k.y;
}
#endif

void main() {
  // Turn the normal into relworld axes.
  vec3 n = draw.normal_from_mesh[0].xyz * normal_mesh.x + draw.normal_from_mesh[1].xyz * normal_mesh.y +
           draw.normal_from_mesh[2].xyz * normal_mesh.z;
#ifdef EMIT_CACHED
  // Interpolate the state of the sample between the two nodes of time.
  float per_length = inversesqrt(max(dot(n, n), 1e-30));
  float cosine = dot(n, frame.to_sun) * per_length * frame.sun_up;
  vec2 now = vec2(offset_now_k(node_before.x, node_after.xy), mix(node_before.z, node_after.z, frame.node_frac));
#ifdef EMIT_CLUTTER
  // Put a parabola through the sample and its twins.
  float low = offset_now_k(low_before, low_after) - now.x;
  float high = offset_now_k(high_before, high_after) - now.x;
  clutter_k = draw.twins * 0.5 *
              vec2((high - low) / EMIT_CLUTTER_TWIN_SD, (high + low) / (EMIT_CLUTTER_TWIN_SD * EMIT_CLUTTER_TWIN_SD));
  vec4 at_mesh = vec4(position_mesh_m, 1.0);
  tile_position = vec3(dot(draw.tile_row[0], at_mesh), dot(draw.tile_row[1], at_mesh), dot(draw.tile_row[2], at_mesh));
#endif
#ifdef EMIT_SHADE
  now.x += shade_k * now.y * max(cosine, 0.0);
  // Take the share of the sky at the attitude of the frame, as far as the entity has moved (view_of_now.hpp).
  vec3 up = vec3(draw.normal_from_mesh[0].w, draw.normal_from_mesh[1].w, draw.normal_from_mesh[2].w);
  float past_hull = clamp(hull.x + dot(hull.yzw, up), 0.0, 2.0 * hull.x);
  float sky_frac = mix(normal_mesh.w, past_hull, draw.moved_frac);
#else
  float sky_frac = normal_mesh.w;
#endif
  sample_state = vec4(frame.reference_k + now.x, now.y, sky_frac, cosine);
#ifdef EMIT_NORMAL
  normal_relworld = n * per_length;
#endif
  // Add up what arrives: the open part of the hemisphere shows sky, the rest surroundings and other samples.
#ifdef EMIT_SEEN
  vec4 incoming = mix(seen_before, seen_after, frame.node_frac);
#else
  vec4 incoming = vec4(0.0);
#endif
  vec2 tilt = sky_tilt_place(n.z * per_length);
  for (uint i = 0u; i < EMIT_BANDS; ++i) {
    incoming[i] += mix(bands[i].surroundings_radiance_w_m2_sr, sky_at_tilt_w_m2_sr(i, tilt), sky_frac);
  }
  incoming_w_m2_sr = EMIT_BANDS_OF(incoming);
#else
  normal_relworld = n;
#endif
  gl_Position = draw.clip_from_mesh * vec4(position_mesh_m, 1.0);
}
