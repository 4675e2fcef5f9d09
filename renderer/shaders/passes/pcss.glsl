// SPDX-License-Identifier: Apache-2.0
// Percentage-closer soft shadows (Fernando 2005) for the sun's disc, in metres of light space.
// Two things are added to the published method, at the same number of taps. Depths are compared on
// the receiver's own plane at every texel, so that slopes need no bias. And the taps are spread along
// the drift of the shadow over the interval (CascadeParams.drift), which turns the shade at one instant
// into its mean over the interval and removes the bands of a coarse history.

layout(binding = EMIT_TEX_SHADOW) uniform sampler2DArray shadow_maps;
layout(std140, binding = EMIT_BIND_STEP) uniform Step { StepParams step_params; };
layout(std140, binding = EMIT_BIND_TAPS) uniform Taps { TapParams taps; };

// Share of the sun's disc seen from a point, 0..1.
float sun_visibility(vec3 p_relworld_m, vec3 n, float boresight_m) {
  uint cascade = 0u;
  while (cascade + 1u < step_params.info.x && boresight_m > step_params.cascades[cascade].scale.w) ++cascade;
  vec4 row0 = step_params.cascades[cascade].light_row0;
  vec4 row1 = step_params.cascades[cascade].light_row1;
  vec4 row2 = step_params.cascades[cascade].light_row2;
  vec3 scale = step_params.cascades[cascade].scale.xyz;
  vec2 drift = step_params.cascades[cascade].drift.xy;
  vec2 casters = step_params.casters.xy;

  vec4 p = vec4(p_relworld_m, 1.0);
  vec3 light_m = vec3(dot(row0, p), dot(row1, p), dot(row2, p));
  vec3 n_light = vec3(dot(row0.xyz, n), dot(row1.xyz, n), dot(row2.xyz, n));
  // Slope of the receiver's plane; the sun's height over the plane is held at 3 degrees or more.
  vec2 slope = -n_light.xy / min(n_light.z, -0.05);

  vec2 map_px = vec2(textureSize(shadow_maps, 0).xy);
  vec2 texel_m = 1.0 / (scale.xy * map_px);
  float texel_max_m = max(texel_m.x, texel_m.y);
  float bias_m = 0.1 * texel_max_m * (1.0 + length(slope)) + 1e-3;
  float tan_sun = tan(EMIT_SUN_SEMI_ANGLE_RAD);

  // Blockers may stand anywhere below the highest caster, along the line to the sun.
  float rise_to_top_m = max(casters.x - p_relworld_m.z, 0.0);
  float max_gap_m = min(light_m.z, rise_to_top_m / max(casters.y, 1e-3) + texel_max_m);
  float search_m = max(max_gap_m * tan_sun, 1.5 * texel_max_m);
  float blocker_sum_m = 0.0;
  float blockers = 0.0;
  for (uint i = 0u; i < EMIT_BLOCKER_TAPS; ++i) {
    // Near blockers drift little, far ones much: the taps try distances from near to far.
    float try_frac = (float(i) + 0.5) / float(EMIT_BLOCKER_TAPS);
    vec2 offset_m = taps.blocker[i].xy * search_m +
                    drift * (taps.blocker[i].z * max_gap_m * try_frac * try_frac);
    ivec2 texel = ivec2(floor((light_m.xy + offset_m) / texel_m));
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, ivec2(map_px)))) continue;
    float depth_m = texelFetch(shadow_maps, ivec3(texel, int(cascade)), 0).r / scale.z;
    float plane_m = light_m.z + dot(slope, (vec2(texel) + 0.5) * texel_m - light_m.xy);
    if (depth_m < plane_m - bias_m) {
      blocker_sum_m += depth_m;
      blockers += 1.0;
    }
  }
  if (blockers == 0.0) return 1.0;

  float gap_m = max(light_m.z - blocker_sum_m / blockers, 0.0);
  float filter_m = max(gap_m * tan_sun, 0.5 * texel_max_m);
  float lit = 0.0;
  for (uint i = 0u; i < EMIT_FILTER_TAPS; ++i) {
    vec2 offset_m = taps.filter_[i].xy * filter_m + drift * (taps.filter_[i].z * gap_m);
    // Bilinear mean of four comparisons, each on the receiver's plane at its texel's centre.
    vec2 at = (light_m.xy + offset_m) / texel_m - 0.5;
    vec2 corner = floor(at);
    vec2 weight = at - corner;
    vec4 depth_m = textureGather(shadow_maps, vec3((corner + 1.0) / map_px, float(cascade))) / scale.z;
    float plane_m = light_m.z + dot(slope, (corner + 0.5) * texel_m - light_m.xy) - bias_m;
    vec2 rise_m = slope * texel_m;
    // Gather order: (0,1) (1,1) (1,0) (0,0).
    vec4 plane4_m = plane_m + vec4(rise_m.y, rise_m.x + rise_m.y, rise_m.x, 0.0);
    vec4 open = vec4(greaterThanEqual(depth_m, plane4_m));
    vec2 rows = mix(open.wx, open.zy, weight.x);
    lit += mix(rows.x, rows.y, weight.y);
  }
  return lit / float(EMIT_FILTER_TAPS);
}
