// SPDX-License-Identifier: Apache-2.0
#include "shared/frame_params.glsl.h"

// What differs from vertex to vertex comes as an attribute, the rest as a uniform block: software rasterisers
// fetch the former much faster than texels, and the latter not once per vertex.
layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_NORMAL) in vec4 normal_mesh;  // cached: w = share of the sky

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(std140, binding = EMIT_BIND_DRAW) uniform Draw { DrawParams draw; };

#ifdef EMIT_CACHED
// Temperature offset in K and visible share of the sun, at the two nodes of time around now.
layout(location = EMIT_ATTR_NODE_BEFORE) in vec2 node_before;
layout(location = EMIT_ATTR_NODE_AFTER) in vec2 node_after;
#ifdef EMIT_SHADE
// What entities have taken off the temperature lately, in full sun, K: pixels have their own.
layout(location = EMIT_ATTR_SHADE) in float shade_k;
#endif
// Temperature in K, share of the sun, share of the sky, cosine of the sun's incidence on the front.
out vec4 sample_state;
#else
out vec3 normal_relworld;
#endif

void main() {
  vec3 n = draw.normal_from_mesh[0].xyz * normal_mesh.x + draw.normal_from_mesh[1].xyz * normal_mesh.y +
           draw.normal_from_mesh[2].xyz * normal_mesh.z;
#ifdef EMIT_CACHED
  float cosine = dot(n, frame.sun_now.xyz) * inversesqrt(max(dot(n, n), 1e-30)) * frame.sun_now.w;
  vec2 now = mix(node_before, node_after, frame.samples.x);
#ifdef EMIT_SHADE
  now.x += shade_k * now.y * max(cosine, 0.0);
#endif
  sample_state = vec4(frame.obscurance.y + now.x, now.y, normal_mesh.w, cosine);
#else
  normal_relworld = n;
#endif
  gl_Position = draw.clip_from_mesh * vec4(position_mesh_m, 1.0);
}
