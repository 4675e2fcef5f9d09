// SPDX-License-Identifier: Apache-2.0
// One interval of the thermal history for every visible surface point, with convection, layers and
// surroundings: soft shadow, surface balance, four flux-driven states. Inside an interval the shade
// is constant (its mean) and everything else linear; the interval is split until step doubling finds
// nothing above the tolerance.
#include "passes/gbuffer.glsl"
#include "passes/pcss.glsl"
#include "passes/tables.glsl"
#include "lib/foster.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = EMIT_IMG_SUN_NOW) writeonly uniform image2D sun_now_image;
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };
layout(binding = EMIT_TEX_OCCLUSION) uniform sampler2D occlusion_texture;
layout(binding = EMIT_TEX_SPIN_UP) uniform samplerBuffer spin_up_table;
layout(rgba32f, binding = EMIT_IMG_STATE) uniform image2D state_image;

// States before the first interval, by material and direction: bilinear over an octahedral grid.
vec4 spun_up_states(int material, vec3 n) {
  int nodes = int(frame.obscurance.w);
  vec2 place = (octahedral_from_unit(n) * 0.5 + 0.5) * float(nodes - 1);
  ivec2 low = clamp(ivec2(floor(place)), ivec2(0), ivec2(nodes - 2));
  vec2 weight = place - vec2(low);
  int at = (material * nodes + low.y) * nodes + low.x;
  vec4 south = mix(texelFetch(spin_up_table, at), texelFetch(spin_up_table, at + 1), weight.x);
  vec4 north = mix(texelFetch(spin_up_table, at + nodes), texelFetch(spin_up_table, at + nodes + 1), weight.x);
  return mix(south, north, weight.y);
}

// Absorbed flux but for the direct sun. `surface` is the first texel of the material.
float absorbed_indirect_w_m2(vec4 surface, vec4 flux, float sky_frac) {
  float short_wave = sky_frac * flux.x + (1.0 - sky_frac) * flux.z;
  float long_wave = sky_frac * flux.y + (1.0 - sky_frac) * flux.w;
  return surface.x * short_wave + surface.y * long_wave;
}

void main() {
  read_frame();
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + frame.format_window_px.xy);
  if (any(greaterThanEqual(px, ivec2(frame.format_window_px.zw)))) return;
  float boresight_m = gbuffer_depth_m(px);
  if (boresight_m >= EMIT_SKY_DEPTH_M) return;

  vec3 n = gbuffer_normal(px);
  uint flags = step_params.info.z;
  bool unshaded = (flags & EMIT_STEP_UNSHADED) != 0u;
  // Direct normal flux on the face at the two ends, before the face turns away.
  float sun_begin = step_params.sun_start.w * dot(n, step_params.sun_start.xyz);
  float sun_end = step_params.sun_end.w * dot(n, step_params.sun_end.xyz);
  bool faces_sun = max(dot(n, step_params.sun_start.xyz), dot(n, step_params.sun_end.xyz)) > 0.0;
  float sun_frac = unshaded ? 1.0 : 0.0;
  if ((flags & EMIT_STEP_SUN_UP) != 0u && faces_sun) {
    sun_frac = sun_visibility(view_ray(px) * boresight_m, n, boresight_m);
  }
  if ((flags & EMIT_STEP_SUN_NOW) != 0u) imageStore(sun_now_image, px, vec4(sun_frac));

  int material = int(gbuffer_ids(px).x);
  vec4 surface = material_surface(material);
  vec4 start = material_start(material);
  if (start.z > 0.5) return;
  // Cosine-weighted share of the sky: what the horizon leaves, times what near geometry leaves.
  float sky_frac = 0.5 * (1.0 + n.z);
  if (!unshaded) sky_frac *= min(2.0 * texelFetch(occlusion_texture, px, 0).r, 1.0);

  FosterSurface s;
  s.resistance_m2k_w = material_resistance_m2k_w(material);
  s.emission_w_m2_k4 = surface.y * EMIT_STEFAN_BOLTZMANN_W_M2_K4;
  s.base_offset_k = start.w;
  s.reference_k = frame.obscurance.y;

  vec3 begin = vec3(absorbed_indirect_w_m2(surface, step_params.flux_start, sky_frac), step_params.film_air.xy);
  vec3 end = vec3(absorbed_indirect_w_m2(surface, step_params.flux_end, sky_frac), step_params.film_air.zw);
  float absorbed_frac = surface.x * sun_frac;
  vec3 lit_begin = begin + vec3(absorbed_frac * max(sun_begin, 0.0), 0.0, 0.0);
  vec3 lit_end = end + vec3(absorbed_frac * max(sun_end, 0.0), 0.0, 0.0);

  vec4 x0 = (flags & EMIT_STEP_FIRST) != 0u ? spun_up_states(material, n) : imageLoad(state_image, px);
  bool clamped = false;
  int entry = int(step_params.info.y) + material * (EMIT_FOSTER_LEVELS + 1);
  vec4 x = foster_step(x0, lit_begin, lit_end, relaxation_mode(entry, 0), relaxation_mode(entry, 1), s, clamped);
  for (int level = 1; level <= EMIT_FOSTER_LEVELS; ++level) {
    vec4 gain_start = relaxation_mode(entry + level, 0);
    vec4 gain_end = relaxation_mode(entry + level, 1);
    int steps = 1 << level;
    vec4 coarse = x;
    x = x0;
    vec3 from = lit_begin;
    for (int i = 1; i <= steps; ++i) {
      float f = float(i) / float(steps);
      vec3 to = mix(begin, end, f);
      to.x += absorbed_frac * max(mix(sun_begin, sun_end, f), 0.0);
      x = foster_step(x, from, to, gain_start, gain_end, s, clamped);
      from = to;
    }
    vec4 change_k = abs(x - coarse);
    float total_k = abs(foster_offset_k(x, s) - foster_offset_k(coarse, s));
    float worst_k = max(max(max(change_k.x, change_k.y), max(change_k.z, change_k.w)), total_k);
    if (!(worst_k > frame.obscurance.z)) break;
  }
  if (clamped) atomicAdd(stats.flagged_px[EMIT_FLAG_CLAMPED], 1u);
  imageStore(state_image, px, x);
}
