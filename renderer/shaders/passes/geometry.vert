// SPDX-License-Identifier: Apache-2.0
#include "shared/frame_params.glsl.h"

// Everything a vertex needs comes as an attribute: software rasterisers fetch those much faster than texels.
layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_NORMAL) in vec4 normal_mesh;  // cached: w = share of the sky
layout(location = EMIT_ATTR_DRAW) in uvec2 draw;          // per instance: material, object id (1 + index)
layout(location = EMIT_ATTR_ROW) in vec4 row0;            // per instance: rows of relworld_from_mesh
layout(location = EMIT_ATTR_ROW + 1) in vec4 row1;
layout(location = EMIT_ATTR_ROW + 2) in vec4 row2;

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };

#ifdef EMIT_CACHED
// Temperature offset in K and visible share of the sun, at the two nodes of time around now.
layout(location = EMIT_ATTR_NODE_BEFORE) in vec2 node_before;
layout(location = EMIT_ATTR_NODE_AFTER) in vec2 node_after;
// Temperature offset in K, share of the sun, share of the sky, cosine of the sun's incidence on the front.
out vec4 sample_state;
#else
out vec3 normal_relworld;
#endif

flat out uvec2 ids;

void main() {
  vec4 p = vec4(position_mesh_m, 1.0);
  vec3 relworld_m = vec3(dot(row0, p), dot(row1, p), dot(row2, p));
  // Normals go with the cofactors of the linear part, which also holds for unequal scales.
  vec3 n = normal_mesh.xyz;
  n = vec3(dot(cross(row1.xyz, row2.xyz), n), dot(cross(row2.xyz, row0.xyz), n), dot(cross(row0.xyz, row1.xyz), n));
  ids = draw;
#ifdef EMIT_CACHED
  float cosine = dot(n, frame.sun_now.xyz) * inversesqrt(max(dot(n, n), 1e-30)) * frame.sun_now.w;
  sample_state = vec4(mix(node_before, node_after, frame.samples.x), normal_mesh.w, cosine);
#else
  normal_relworld = n;
#endif
  gl_Position = frame.clip_from_relworld * vec4(relworld_m, 1.0);
}
