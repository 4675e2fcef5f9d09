// SPDX-License-Identifier: Apache-2.0
// Shader of `emit evaluate air-path`, `air-sky` and `air-sun`. Input row, two vectors: first node of the table, 1 for the
// sky, height of the target or sine of the elevation, range in m; then the first node of the table of scattered sunlight
// or -1, the cosine of the angle to the sun, and two zeros. Output row: transmittance for three sources, then radiance in
// W m-2 sr-1. The constants are the nodes of the tables.
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Inputs { vec4 in_row[]; };
layout(std430, binding = 1) writeonly buffer Outputs { vec4 out_row[]; };
layout(std430, binding = 2) readonly buffer Constants { vec4 nodes[]; };
layout(location = 0) uniform uint row_count;

#define EMIT_AIR_VIEW(index) nodes[index]
#include "lib/air_view.glsl"

void main() {
  uint row = gl_GlobalInvocationID.x;
  if (row >= row_count) return;
  vec4 place = in_row[2u * row];
  vec4 sun = in_row[2u * row + 1u];
  if (place.y > 0.5) {
    AirPlace at = air_view_sky_place(place.z);
    vec4 sky = air_view_node(int(place.x), at);
    if (sun.x >= 0.0) sky.w += air_sun_w_m2_sr(int(sun.x), at, sun.y);
    out_row[row] = vec4(exp(-sky.xyz), sky.w);
  } else {
    AirPlace at = air_view_sight_place(place.z, place.w);
    vec4 sight = air_view_node(int(place.x), at);
    if (sun.x >= 0.0) sight.w += air_sun_w_m2_sr(int(sun.x), at, sun.y);
    out_row[row] = vec4(air_view_transmittance(sight.x, place.w), air_view_transmittance(sight.y, place.w),
                        air_view_transmittance(sight.z, place.w), air_view_path_w_m2_sr(sight, place.w));
  }
}
