// SPDX-License-Identifier: Apache-2.0
// Depth from the sun. The rows of clip_from_mesh come with each instance, composed in double on the
// CPU: one transform per vertex is what a history of shadow maps costs most.
#include "shared/bindings.glsl.h"

layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_ROW) in vec4 clip_from_mesh_row[3];

void main() {
  vec4 p = vec4(position_mesh_m, 1.0);
  gl_Position = vec4(dot(clip_from_mesh_row[0], p), dot(clip_from_mesh_row[1], p), dot(clip_from_mesh_row[2], p), 1.0);
}
