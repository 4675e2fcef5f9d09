// SPDX-License-Identifier: Apache-2.0
#include "shared/frame_params.glsl.h"

layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_NORMAL) in vec4 normal_mesh;
layout(location = EMIT_ATTR_DRAW) in uvec2 draw;  // per instance: instance slot, material

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(binding = EMIT_TEX_INSTANCES) uniform samplerBuffer instances;  // rows of InstanceParams

#ifdef EMIT_CACHED
// By thermal sample: temperature offset in K and visible share of the sun, at the two nodes of time around now.
layout(binding = EMIT_TEX_NODE_BEFORE) uniform samplerBuffer node_before;
layout(binding = EMIT_TEX_NODE_AFTER) uniform samplerBuffer node_after;
layout(binding = EMIT_TEX_SAMPLE_SKY) uniform samplerBuffer sample_sky;
out vec3 sample_state;  // temperature offset in K, share of the sun, share of the sky
#endif

out vec3 normal_relworld;
flat out uvec2 ids;

void main() {
  vec4 row0 = texelFetch(instances, int(draw.x) * 4);
  vec4 row1 = texelFetch(instances, int(draw.x) * 4 + 1);
  vec4 row2 = texelFetch(instances, int(draw.x) * 4 + 2);
  vec4 p = vec4(position_mesh_m, 1.0);
  vec3 relworld_m = vec3(dot(row0, p), dot(row1, p), dot(row2, p));
  // Normals go with the cofactors of the linear part, which also holds for unequal scales.
  vec3 n = normal_mesh.xyz;
  normal_relworld = vec3(dot(cross(row1.xyz, row2.xyz), n), dot(cross(row2.xyz, row0.xyz), n),
                         dot(cross(row0.xyz, row1.xyz), n));
  vec4 instance_ids = texelFetch(instances, int(draw.x) * 4 + 3);
  ids = uvec2(draw.y, uint(instance_ids.x));
#ifdef EMIT_CACHED
  int at = 4096 * int(instance_ids.y) + int(instance_ids.z) + gl_VertexID;
  sample_state = vec3(mix(texelFetch(node_before, at).xy, texelFetch(node_after, at).xy, frame.samples.x),
                      texelFetch(sample_sky, at).x);
#endif
  gl_Position = frame.clip_from_relworld * vec4(relworld_m, 1.0);
}
