// SPDX-License-Identifier: Apache-2.0
// Percentage-closer soft shadows (Fernando 2005) for the sun's disc, in metres of light space.
// Two things are added to the published method at the same number of taps. Depths are compared on the receiver's own
// plane at every texel, so slopes need no bias. The taps are spread along the drift of the shadow over the interval
// (CascadeParams.drift_frac). This turns the shade at one instant into its mean over the interval and removes the bands
// of a coarse history.

layout(binding = EMIT_TEX_SHADOW) uniform sampler2DArray shadow_maps;
layout(std140, binding = EMIT_BIND_STEP) uniform Step { StepParams step_params; };
layout(std140, binding = EMIT_BIND_TAPS) uniform Taps { TapParams taps; };

// Search radius in texels above which the taps of the blocker search are too sparse to be trusted alone.
const float kWideSearchPx = 16.0;

// Share of the sun's disc that a point sees, 0..1. `n` is the unit normal of the receiver, relworld. `boresight_m` is
// the distance of the point along the boresight.
float sun_visibility(vec3 p_relworld_m, vec3 n, float boresight_m) {
  // Choose the light frustum that serves the distance of the point.
  if (step_params.cascade_count == 0u) return 1.0;
  uint cascade = 0u;
  while (cascade + 1u < step_params.cascade_count && boresight_m > step_params.cascades[cascade].end_boresight_m) {
    ++cascade;
  }
  vec4 row0 = step_params.cascades[cascade].light_row0;
  vec4 row1 = step_params.cascades[cascade].light_row1;
  vec4 row2 = step_params.cascades[cascade].light_row2;
  vec3 scale = step_params.cascades[cascade].scale_per_m;
  vec2 drift = step_params.cascades[cascade].drift_frac;

  // Transform point and normal into light space.
  vec4 p = vec4(p_relworld_m, 1.0);
  vec3 light_m = vec3(dot(row0, p), dot(row1, p), dot(row2, p));
  vec3 n_light = vec3(dot(row0.xyz, n), dot(row1.xyz, n), dot(row2.xyz, n));
  // Compute the slope of the receiver's plane. The sun's height over the plane is held at 3 degrees or more.
  vec2 slope = -n_light.xy / min(n_light.z, -0.05);

  vec2 map_px = vec2(textureSize(shadow_maps, 0).xy);
  vec2 px_per_m = scale.xy * map_px;
  vec2 texel_m = 1.0 / px_per_m;
  float texel_max_m = max(texel_m.x, texel_m.y);
  float bias_m = 0.1 * texel_max_m * (1.0 + length(slope)) + 1e-3;
  float tan_sun = tan(EMIT_SUN_SEMI_ANGLE_RAD);

  // Convert lengths to texels across the map and depth to the map's own unit.
  vec2 at_px = light_m.xy * px_per_m;
  vec2 drift_px = drift * px_per_m;
  vec2 slope_px = slope * texel_m * scale.z;
  float limit = (light_m.z - bias_m) * scale.z;

  // Search for blockers. They may stand anywhere below the highest caster, along the line to the sun.
  float rise_to_top_m = max(step_params.casters_top_m - p_relworld_m.z, 0.0);
  float max_gap_m = min(light_m.z, rise_to_top_m / max(step_params.casters_sun_sine, 1e-3) + texel_max_m);
  vec2 search_px = max(max_gap_m * tan_sun, 1.5 * texel_max_m) * px_per_m;
  float blocker_sum = 0.0;
  float blockers = 0.0;
  for (uint i = 0u; i < EMIT_BLOCKER_TAPS; ++i) {
    // Try distances from near to far, because near blockers drift little and far blockers much.
    vec4 tap = taps.blocker[i];
    vec2 texel = floor(at_px + tap.xy * search_px + drift_px * (tap.z * tap.w * max_gap_m));
    if (any(lessThan(texel, vec2(0.0))) || any(greaterThanEqual(texel, map_px))) continue;
    float depth = texelFetch(shadow_maps, ivec3(ivec2(texel), int(cascade)), 0).r;
    if (depth < limit + dot(slope_px, texel + 0.5 - at_px)) {
      blocker_sum += depth;
      blockers += 1.0;
    }
  }
  // Look along the receiver's own line to the sun too when the search is wide. With something very tall in the scene
  // (a mast, a mountain) the taps step over things that stand near.
  if (blockers == 0.0 && max(search_px.x, search_px.y) > kWideSearchPx) {
    vec2 texel = floor(at_px);
    if (all(greaterThanEqual(texel, vec2(0.0))) && all(lessThan(texel, map_px))) {
      float depth = texelFetch(shadow_maps, ivec3(ivec2(texel), int(cascade)), 0).r;
      if (depth < limit + dot(slope_px, texel + 0.5 - at_px)) {
        blocker_sum = depth;
        blockers = 1.0;
      }
    }
  }
  if (blockers == 0.0) return 1.0;

  // Compute the radius of the filter from the mean distance of the blockers.
  float gap_m = max(light_m.z - blocker_sum / (blockers * scale.z), 0.0);
  vec2 filter_px = max(gap_m * tan_sun, 0.5 * texel_max_m) * px_per_m;
  vec2 gap_drift_px = drift_px * gap_m;
  vec2 texel_uv = 1.0 / map_px;
  // Compute the steps of the plane to the gathered texels, in the order (0,1) (1,1) (1,0) (0,0).
  vec4 rise = vec4(slope_px.y, slope_px.x + slope_px.y, slope_px.x, 0.0);
  float lit = 0.0;
  for (uint i = 0u; i < EMIT_FILTER_TAPS; ++i) {
    // Take the bilinear mean of four comparisons, each on the receiver's plane at the centre of its texel.
    vec4 tap = taps.filter_[i];
    vec2 offset_px = tap.xy * filter_px + gap_drift_px * tap.z - 0.5;
    vec2 corner = floor(at_px + offset_px);
    vec2 weight = at_px + offset_px - corner;
    vec4 depth = textureGather(shadow_maps, vec3((corner + 1.0) * texel_uv, float(cascade)));
    vec4 plane = limit + dot(slope_px, corner + 0.5 - at_px) + rise;
    vec4 open = vec4(greaterThanEqual(depth, plane));
    vec2 rows = mix(open.wx, open.zy, weight.x);
    lit += mix(rows.x, rows.y, weight.y);
  }
  return lit / float(EMIT_FILTER_TAPS);
}
