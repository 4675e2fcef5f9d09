// SPDX-License-Identifier: Apache-2.0
// Advances every visible surface point over one interval of the thermal history: soft shadow, absorbed flux
// (physics.md eq. 1), equilibrium temperature (eq. 4), and the exact relaxation of two modes (eq. 5 and 6). Inside an
// interval the shade is constant, at its mean, and the drive is linear between the equilibria at the two ends. With
// EMIT_SUN_ONLY the pass stores the shade of the last step and changes no temperature.
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

// Sun and fluxes at one end of the interval, as StepParams holds them.
struct IntervalEnd {
  vec3 to_sun;
  float sun_w_m2;
  float diffuse_w_m2;
  float longwave_w_m2;
  float environment_w_m2;
};

// Equilibrium temperature (physics.md eq. 1 and 4) minus the reference temperature, in K. `surface` is the first texel
// of the material. Sets `clamped` where an input lies outside its range.
float equilibrium_offset_k(vec4 surface, vec3 n, IntervalEnd end, float sun_frac, float sky_frac, inout bool clamped) {
  float direct_w_m2 = end.sun_w_m2 * max(dot(n, end.to_sun), 0.0);
  float absorbed_w_m2 = absorbed_flux_w_m2(direct_w_m2, end.diffuse_w_m2, surface.y * end.environment_w_m2,
                                           end.longwave_w_m2, 0.0, sun_frac, sky_frac, surface.x, surface.y);
  vec3 balance = surface_balance(absorbed_w_m2, surface.y, surface.z, surface.w, 0.0, 0.0);
  return equilibrium_k(balance.x, balance.y, balance.z, clamped) - frame.reference_k;
}
#endif

void main() {
  // Leave pixels outside the window and pixels of the sky.
  read_frame();
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + frame.rendered_window_px.xy);
  if (any(greaterThanEqual(px, ivec2(frame.rendered_window_px.zw)))) return;
  float boresight_m = gbuffer_depth_m(px);
  if (boresight_m >= EMIT_SKY_DEPTH_M) return;

  // Compute the visible share of the sun. A face that is turned away at both ends takes no direct sun, whatever the
  // shadow maps hold.
  vec3 n = gbuffer_normal(px);
  uint flags = step_params.flags;
  bool faces_sun = max(dot(n, step_params.to_sun_start), dot(n, step_params.to_sun_end)) > 0.0;
  float sun_frac = 0.0;
  if ((flags & EMIT_STEP_SUN_UP) != 0u && faces_sun) {
    sun_frac = sun_visibility(view_ray(px) * boresight_m, n, boresight_m);
  }
  if ((flags & EMIT_STEP_SUN_NOW) != 0u) imageStore(sun_now_image, px, vec4(sun_frac));

#ifndef EMIT_SUN_ONLY
  // Read the material. A prescribed temperature needs no step.
  int material = int(gbuffer_ids(px).x);
  vec4 surface = material_surface(material);
  vec4 start = material_start(material);
  if (start.z > 0.5) return;
  float sky_frac = texelFetch(occlusion_texture, px, 0).r;

  // Compute the equilibrium at both ends of the interval.
  IntervalEnd start_of_step =
      IntervalEnd(step_params.to_sun_start, step_params.sun_start_w_m2, step_params.diffuse_start_w_m2,
                  step_params.longwave_start_w_m2, step_params.environment_start_w_m2);
  IntervalEnd end_of_step =
      IntervalEnd(step_params.to_sun_end, step_params.sun_end_w_m2, step_params.diffuse_end_w_m2,
                  step_params.longwave_end_w_m2, step_params.environment_end_w_m2);
  bool clamped = false;
  float u0 = equilibrium_offset_k(surface, n, start_of_step, sun_frac, sky_frac, clamped);
  float u1 = equilibrium_offset_k(surface, n, end_of_step, sun_frac, sky_frac, clamped);
  if (clamped) atomicAdd(stats.flagged_px[EMIT_FLAG_CLAMPED], 1u);

  // Relax both modes towards it.
  vec2 x = (flags & EMIT_STEP_FIRST) != 0u ? vec2(start.x) : imageLoad(state_image, px).rg;
  int entry = int(step_params.relaxation_offset) + material;
  x.x = relax_linear(x.x, u0, u1, relaxation_mode(entry, 0).xy);
  x.y = relax_linear(x.y, u0, u1, relaxation_mode(entry, 1).xy);
  imageStore(state_image, px, vec4(x, 0.0, 0.0));
#endif
}
