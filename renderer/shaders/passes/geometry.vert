// SPDX-License-Identifier: Apache-2.0
#include "shared/frame_params.glsl.h"

layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_NORMAL) in vec4 normal_mesh;
layout(location = EMIT_ATTR_DRAW) in uvec2 draw;  // per instance: instance slot, material

layout(std140, binding = EMIT_BIND_FRAME) uniform Frame { FrameParams frame; };
layout(binding = EMIT_TEX_INSTANCES) uniform samplerBuffer instances;  // rows of InstanceParams

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
  ids = uvec2(draw.y, uint(texelFetch(instances, int(draw.x) * 4 + 3).x));
  gl_Position = frame.clip_from_relworld * vec4(relworld_m, 1.0);
}
