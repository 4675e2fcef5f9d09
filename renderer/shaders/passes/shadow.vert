// SPDX-License-Identifier: Apache-2.0
// Vertex shader of the shadow pass: depth seen from the sun. The CPU composes the rows of clip_from_mesh in double and
// sends them with each instance, because one transform per vertex is the largest cost of a history of shadow maps.
#include "shared/bindings.glsl.h"

layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_ROW) in vec4 clip_from_mesh_row[3];

void main() {
  // Project in parallel: clip w is 1.
  vec4 p = vec4(position_mesh_m, 1.0);
  gl_Position = vec4(dot(clip_from_mesh_row[0], p), dot(clip_from_mesh_row[1], p), dot(clip_from_mesh_row[2], p), 1.0);
}
