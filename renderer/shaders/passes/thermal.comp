// SPDX-License-Identifier: Apache-2.0
// One interval of the thermal history for every visible surface point: soft shadow, Eq. 1, Eq. 5
// (stable root) and the exact two-mode relaxation. Inside an interval the shade is constant (its
// mean) and the drive linear between the equilibria at the two ends.
// With EMIT_SUN_ONLY the pass stores the shade of the last step and touches no temperature.
#include "passes/gbuffer.glsl"
#include "passes/pcss.glsl"
#include "passes/tables.glsl"
#include "lib/balance.glsl"
#include "lib/equilibrium.glsl"
#include "lib/relaxation.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = EMIT_IMG_SUN_NOW) writeonly uniform image2D sun_now_image;

#ifndef EMIT_SUN_ONLY
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };
layout(binding = EMIT_TEX_OCCLUSION) uniform sampler2D occlusion_texture;
layout(rg32f, binding = EMIT_IMG_STATE) uniform image2D state_image;

// Equilibrium (Eq. 1 and 5) as an offset. `surface` is the first texel of the material.
float equilibrium_offset_k(vec4 surface, vec3 n, vec4 sun, vec4 flux, float sun_frac, float sky_frac,
                           inout bool clamped) {
  float direct_w_m2 = sun.w * max(dot(n, sun.xyz), 0.0);
  float absorbed_w_m2 = absorbed_flux_w_m2(direct_w_m2, flux.x, surface.y * flux.z, flux.y, 0.0, sun_frac, sky_frac,
                                           surface.x, surface.y);
  vec3 balance = surface_balance(absorbed_w_m2, surface.y, surface.z, surface.w, 0.0, 0.0);
  return equilibrium_k(balance.x, balance.y, balance.z, clamped) - frame.obscurance.y;
}
#endif

void main() {
  read_frame();
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + frame.format_window_px.xy);
  if (any(greaterThanEqual(px, ivec2(frame.format_window_px.zw)))) return;
  float boresight_m = gbuffer_depth_m(px);
  if (boresight_m >= EMIT_SKY_DEPTH_M) return;

  vec3 n = gbuffer_normal(px);
  vec4 sun_start = step_params.sun_start;
  vec4 sun_end = step_params.sun_end;
  uint flags = step_params.info.z;
  // A face turned away at both ends takes no direct sun whatever the maps say.
  bool faces_sun = max(dot(n, sun_start.xyz), dot(n, sun_end.xyz)) > 0.0;
  float sun_frac = 0.0;
  if ((flags & EMIT_STEP_SUN_UP) != 0u && faces_sun) {
    sun_frac = sun_visibility(view_ray(px) * boresight_m, n, boresight_m);
  }
  if ((flags & EMIT_STEP_SUN_NOW) != 0u) imageStore(sun_now_image, px, vec4(sun_frac));

#ifndef EMIT_SUN_ONLY
  int material = int(gbuffer_ids(px).x);
  vec4 surface = material_surface(material);
  vec4 start = material_start(material);
  if (start.z > 0.5) return;
  float sky_frac = texelFetch(occlusion_texture, px, 0).r;

  bool clamped = false;
  float u0 = equilibrium_offset_k(surface, n, sun_start, step_params.flux_start, sun_frac, sky_frac, clamped);
  float u1 = equilibrium_offset_k(surface, n, sun_end, step_params.flux_end, sun_frac, sky_frac, clamped);
  if (clamped) atomicAdd(stats.flagged_px[EMIT_FLAG_CLAMPED], 1u);

  vec2 x = (flags & EMIT_STEP_FIRST) != 0u ? vec2(start.x) : imageLoad(state_image, px).rg;
  int entry = int(step_params.info.y) + material;
  x.x = relax_linear(x.x, u0, u1, relaxation_mode(entry, 0).xy);
  x.y = relax_linear(x.y, u0, u1, relaxation_mode(entry, 1).xy);
  imageStore(state_image, px, vec4(x, 0.0, 0.0));
#endif
}
