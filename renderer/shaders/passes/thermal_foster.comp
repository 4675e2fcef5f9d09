// SPDX-License-Identifier: Apache-2.0
// Advances every visible surface point over one interval of the thermal history, with convection, layers and
// surroundings: soft shadow, surface balance, up to six flux-driven states (physics.md eq. 16 to 18). Inside an interval the
// shade is constant, at its mean, and everything else is linear. The interval is split until doubling the number of
// steps changes nothing by more than the tolerance.
#include "passes/gbuffer.glsl"
#include "passes/pcss.glsl"
#include "passes/tables.glsl"
#include "lib/air_film.glsl"
#include "lib/foster.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = EMIT_IMG_SUN_NOW) writeonly uniform image2D sun_now_image;
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };
layout(binding = EMIT_TEX_OCCLUSION) uniform sampler2D occlusion_texture;
layout(binding = EMIT_TEX_SPIN_UP) uniform samplerBuffer spin_up_table;
layout(rgba32f, binding = EMIT_IMG_STATE) uniform image2D state_image;

// Four states of a node of the spin-up table. `group` counts the modes by fours.
vec4 spin_up_texel(int node, int group) { return texelFetch(spin_up_table, node * EMIT_FOSTER_TEXELS + group); }

// States before the first interval for a material and a direction, bilinear over an octahedral grid of directions.
FosterModes spun_up_states(int material, vec3 n) {
  int nodes = int(frame.spin_up_nodes);
  vec2 place = (octahedral_from_unit(n) * 0.5 + 0.5) * float(nodes - 1);
  ivec2 low = clamp(ivec2(floor(place)), ivec2(0), ivec2(nodes - 2));
  vec2 weight = place - vec2(low);
  int at = (material * nodes + low.y) * nodes + low.x;
  FosterModes states;
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) {
    vec4 south = mix(spin_up_texel(at, g), spin_up_texel(at + 1, g), weight.x);
    vec4 north = mix(spin_up_texel(at + nodes, g), spin_up_texel(at + nodes + 1, g), weight.x);
    states.group[g] = mix(south, north, weight.y);
  }
  return states;
}

// States of a pixel. Those of the second group lie below the image of the first.
ivec2 state_place(ivec2 px, int group) { return px + ivec2(0, group * (imageSize(state_image).y / EMIT_FOSTER_GROUPS)); }
FosterModes stored_states(ivec2 px) {
  FosterModes states;
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) states.group[g] = imageLoad(state_image, state_place(px, g));
  return states;
}
void store_states(ivec2 px, FosterModes states) {
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) imageStore(state_image, state_place(px, g), states.group[g]);
}

// Gains of the modes for the flux at the start (`end` = 0) and at the end (1) of a step.
FosterModes foster_gains(int entry, int level, int end) {
  FosterModes gains;
  int at = foster_gains_at(entry, level) + end;
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) gains.group[g] = texelFetch(relaxation_table, at + 2 * g);
  return gains;
}

// Short-wave irradiance of a face without the direct sun.
float shortwave_indirect_w_m2(float diffuse_w_m2, float reflected_w_m2, float sky_frac) {
  return sky_frac * diffuse_w_m2 + (1.0 - sky_frac) * reflected_w_m2;
}

// Drive of a face without the direct sun. `surface` is the first texel of the material, `shortwave_w_m2` the
// irradiance without the direct sun.
FosterDrive indirect_drive(vec4 surface, float shortwave_w_m2, float longwave_w_m2, float environment_w_m2,
                           float sky_frac, float film_w_m2_k, float air_offset_k) {
  float long_wave = sky_frac * longwave_w_m2 + (1.0 - sky_frac) * environment_w_m2;
  return FosterDrive(vec3(surface.x * shortwave_w_m2 + surface.y * long_wave, film_w_m2_k, air_offset_k), vec3(0.0));
}

void main() {
  // Leave pixels outside the window and pixels of the sky.
  read_frame();
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + frame.rendered_window_px.xy);
  if (any(greaterThanEqual(px, ivec2(frame.rendered_window_px.zw)))) return;
  float boresight_m = gbuffer_depth_m(px);
  if (boresight_m >= EMIT_SKY_DEPTH_M) return;

  // Compute the direct flux on the face at the two ends. It is negative where the face is turned away.
  vec3 n = gbuffer_normal(px);
  uint flags = step_params.flags;
  bool unshaded = (flags & EMIT_STEP_UNSHADED) != 0u;
  float sun_begin = step_params.sun_start_w_m2 * dot(n, step_params.to_sun_start);
  float sun_end = step_params.sun_end_w_m2 * dot(n, step_params.to_sun_end);
  // Compute the visible share of the sun.
  bool faces_sun = max(dot(n, step_params.to_sun_start), dot(n, step_params.to_sun_end)) > 0.0;
  float sun_frac = unshaded ? 1.0 : 0.0;
  if ((flags & EMIT_STEP_SUN_UP) != 0u && faces_sun) {
    sun_frac = sun_visibility(view_ray(px) * boresight_m, n, boresight_m);
  }
  if ((flags & EMIT_STEP_SUN_NOW) != 0u) imageStore(sun_now_image, px, vec4(sun_frac));

  // Read the material. A prescribed temperature needs no step.
  int material = int(gbuffer_ids(px).x);
  vec4 surface = material_surface(material);
  vec4 start = material_start(material);
  if (start.z > 0.5) return;
  // Estimate the cosine-weighted share of the sky: the share above the horizon times the share that near geometry
  // leaves.
  float sky_frac = 0.5 * (1.0 + n.z);
  if (!unshaded) sky_frac *= min(2.0 * texelFetch(occlusion_texture, px, 0).r, 1.0);

  FosterSurface s;
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) {
    s.resistance_m2k_w.group[g] = material_resistance_m2k_w(material, g);
  }
  s.emission_w_m2_k4 = surface.y * EMIT_STEFAN_BOLTZMANN_W_M2_K4;
  s.base_offset_k = start.w;
  s.reference_k = frame.reference_k;

  // Read the states and take the film at the temperature at the start.
  FosterModes x0;
  if ((flags & EMIT_STEP_FIRST) != 0u) {
    x0 = spun_up_states(material, n);
  } else {
    x0 = stored_states(px);
  }
  vec3 skin = material_skin(material);
  float excess_k = foster_offset_k(x0, s) - step_params.air_start_offset_k;
  // Set up the drive at both ends: absorbed flux, film coefficient, air temperature, exchange of water.
  float short_begin = shortwave_indirect_w_m2(step_params.diffuse_start_w_m2, step_params.reflected_start_w_m2,
                                              sky_frac);
  float short_end = shortwave_indirect_w_m2(step_params.diffuse_end_w_m2, step_params.reflected_end_w_m2, sky_frac);
  FosterDrive begin = indirect_drive(surface, short_begin, step_params.longwave_start_w_m2,
                                     step_params.environment_start_w_m2, sky_frac,
                                     film_w_m2_k(step_params.film_start, n, skin, excess_k),
                                     step_params.air_start_offset_k);
  FosterDrive end = indirect_drive(surface, short_end, step_params.longwave_end_w_m2,
                                   step_params.environment_end_w_m2, sky_frac,
                                   film_w_m2_k(step_params.film_end, n, skin, excess_k),
                                   step_params.air_end_offset_k);
  int entry = int(step_params.relaxation_offset) + material * EMIT_FOSTER_ENTRIES;
  vec3 water = material_water(material);
  vec2 wet_frac = rain_wet_frac(entry, n.z);
  begin.moist = moist_drive(water, wet_frac.x, step_params.moist_start, begin.dry.y,
                            short_begin + sun_frac * max(sun_begin, 0.0));
  end.moist = moist_drive(water, wet_frac.y, step_params.moist_end, end.dry.y,
                          short_end + sun_frac * max(sun_end, 0.0));
  float absorbed_frac = surface.x * sun_frac;
  FosterDrive lit_begin = begin;
  lit_begin.dry.x += absorbed_frac * max(sun_begin, 0.0);
  FosterDrive lit_end = end;
  lit_end.dry.x += absorbed_frac * max(sun_end, 0.0);

  // Advance over the whole interval in one step.
  bool clamped = false;
  FosterModes x =
      foster_step(x0, lit_begin, lit_end, foster_gains(entry, 0, 0), foster_gains(entry, 0, 1), s, clamped);
  // Double the number of steps until neither a state nor the temperature changes by more than the tolerance.
  for (int level = 1; level <= EMIT_FOSTER_LEVELS; ++level) {
    FosterModes gain_start = foster_gains(entry, level, 0);
    FosterModes gain_end = foster_gains(entry, level, 1);
    int steps = 1 << level;
    FosterModes coarse = x;
    x = x0;
    FosterDrive from = lit_begin;
    for (int i = 1; i <= steps; ++i) {
      float f = float(i) / float(steps);
      FosterDrive to = drive_between(begin, end, f);
      to.dry.x += absorbed_frac * max(mix(sun_begin, sun_end, f), 0.0);
      x = foster_step(x, from, to, gain_start, gain_end, s, clamped);
      from = to;
    }
    float worst_k = abs(foster_offset_k(x, s) - foster_offset_k(coarse, s));
    for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) {
      vec4 change_k = abs(x.group[g] - coarse.group[g]);
      worst_k = max(worst_k, max(max(change_k.x, change_k.y), max(change_k.z, change_k.w)));
    }
    if (!(worst_k > frame.step_tolerance_k)) break;
  }
  if (clamped) atomicAdd(stats.flagged_px[EMIT_FLAG_CLAMPED], 1u);
  store_states(px, x);
}
