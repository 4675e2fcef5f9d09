// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_FOG
#define EMIT_LIB_FOG

// Level layer of fog (physics.md section 17). Twin of emit/physics/sky/fog.hpp.
const float kFogFarM = 1e8;  // range of a line of sight that meets no surface

// Part of a line of sight of `range_m` that lies in fog, whose top lies `above_m` above the sensor: x = where it begins, y
// = its length, 0 where the line does not meet the fog (physics.md eq. 91).
vec2 fog_stretch(float above_m, float sin_elevation, float range_m) {
  float rise_m = sin_elevation * range_m;
  if (above_m > 0.0) return vec2(0.0, rise_m > above_m ? above_m / sin_elevation : range_m);
  if (!(rise_m < above_m)) return vec2(0.0);
  float begin_m = above_m / sin_elevation;
  return vec2(begin_m, range_m - begin_m);
}

// Returns the share of a part of the fog's light that a stretch of an optical depth sends to its begin. The part has the
// logarithms `begin_log` and `end_log` at its two ends, and is exponential in between.
float fog_part(float depth, float through, float begin_log, float end_log) {
  float x = depth + begin_log - end_log;
  float size = abs(x);
  float mean = size < 1e-3 ? 1.0 - 0.5 * size : (1.0 - exp(-size)) / size;
  return depth * mean * (x < 0.0 ? through * exp(end_log) : exp(begin_log));
}

// Returns what a stretch of fog sends to its begin, `below_top_m` below the top, W m-2 sr-1 (physics.md eq. 93).
// `light` has the radiances of physics::FogLight: blackbody, sky, ground and sun; `rates` its rates by height, that of the
// sun's part second, and the depth of the layer over the ground.
float fog_glow_w_m2_sr(vec4 light, vec3 rates, float per_m, float below_top_m, float sin_elevation, float length_m) {
  float depth = per_m * length_m;
  float through = exp(-depth);
  float end_m = below_top_m - sin_elevation * length_m;
  vec2 below_m = max(vec2(below_top_m, end_m), 0.0);
  vec2 above_m = max(rates.z - vec2(below_top_m, end_m), 0.0);
  return light.x * (1.0 - through) +
         light.y * fog_part(depth, through, -rates.x * below_m.x, -rates.x * below_m.y) +
         light.z * fog_part(depth, through, -rates.x * above_m.x, -rates.x * above_m.y) +
         light.w * fog_part(depth, through, -rates.y * below_m.x, -rates.y * below_m.y);
}

#endif
