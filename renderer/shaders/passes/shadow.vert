// SPDX-License-Identifier: Apache-2.0
#include "shared/frame_params.glsl.h"

layout(location = EMIT_ATTR_POSITION) in vec3 position_mesh_m;
layout(location = EMIT_ATTR_DRAW) in uvec2 draw;

layout(binding = EMIT_TEX_INSTANCES) uniform samplerBuffer instances;  // rows of InstanceParams
layout(std140, binding = EMIT_BIND_STEP) uniform Step { StepParams step_params; };

layout(location = 0) uniform uint cascade;

void main() {
  vec4 row0 = texelFetch(instances, int(draw.x) * 4);
  vec4 row1 = texelFetch(instances, int(draw.x) * 4 + 1);
  vec4 row2 = texelFetch(instances, int(draw.x) * 4 + 2);
  vec4 p = vec4(position_mesh_m, 1.0);
  vec4 relworld_m = vec4(dot(row0, p), dot(row1, p), dot(row2, p), 1.0);
  vec3 light_m = vec3(dot(step_params.cascades[cascade].light_row0, relworld_m),
                      dot(step_params.cascades[cascade].light_row1, relworld_m),
                      dot(step_params.cascades[cascade].light_row2, relworld_m));
  vec3 unit = light_m * step_params.cascades[cascade].scale.xyz;
  gl_Position = vec4(unit.xy * 2.0 - 1.0, unit.z, 1.0);
}
