// SPDX-License-Identifier: Apache-2.0
// In-band radiance at the aperture: emission and reflection of the surface, through the atmosphere;
// sky where there is no surface. Writes the planes that are read back, NaN and Inf counted and
// replaced by zero.
#include "passes/gbuffer.glsl"
#include "passes/tables.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(std140, binding = EMIT_BIND_BANDS) uniform Bands { BandParams bands[EMIT_MAX_BANDS]; };
layout(binding = EMIT_TEX_BAND_LUT) uniform samplerBuffer band_lut;
layout(std430, binding = EMIT_BIND_OUTPUT) writeonly buffer Planes { float planes[]; };
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };
layout(binding = EMIT_TEX_OCCLUSION) uniform sampler2D occlusion_texture;
layout(binding = EMIT_TEX_STATE) uniform sampler2D state_texture;
layout(binding = EMIT_TEX_SUN_NOW) uniform sampler2D sun_now_texture;

#define EMIT_PLANCK_LUT(index) texelFetch(band_lut, index).r
#include "lib/planck_lut.glsl"
// Tables of the air lie behind those of the bands.
#define EMIT_ATMOSPHERE_TABLE(index) texelFetch(band_lut, index).r
#include "lib/atmosphere_table.glsl"

// Relative air mass after Kasten and Young (1989), 1 at the zenith, 38 at the horizon.
float air_mass(float sin_elevation) {
  float elevation_deg = asin(clamp(sin_elevation, 0.0, 1.0)) * (180.0 / EMIT_PI);
  return 1.0 / (max(sin_elevation, 0.0) + 0.50572 * exp(-1.6364 * log(elevation_deg + 6.07995)));
}

float sky_radiance_w_m2_sr(uint band, float sin_elevation) {
  return bands[band].air_radiance_w_m2_sr * (1.0 - exp(log(max(bands[band].vertical_transmittance_frac, 1e-30)) * air_mass(sin_elevation)));
}

float transmittance(uint band, float range_m) {
  return dot(bands[band].terms_amplitude_frac, exp(-bands[band].terms_extinction_per_m * range_m));
}

void main() {
  ivec2 px = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(px, ivec2(frame.format_px.xy)))) return;
  uint pixel = uint(px.y) * frame.format_px.x + uint(px.x);
  uint plane_px = frame.format_px.z;
  float boresight_m = gbuffer_depth_m(px);
  vec3 ray = view_ray(px);
  float ray_length = length(ray);
  bool surface = boresight_m < EMIT_SKY_DEPTH_M;
  bool clamped = false;
  bool nonfinite = false;

  float temperature_k = uintBitsToFloat(0x7fc00000u);
  uvec2 ids = uvec2(0u);
  vec4 emissivity = vec4(1.0);
  vec3 n = vec3(0.0);
  float open_frac = 0.5;  // share of the hemisphere that shows sky, cosine-weighted
  float sun_frac = 0.0;
  if (surface) {
    ids = gbuffer_ids(px);
    n = gbuffer_normal(px);
#ifdef EMIT_CACHED
    vec3 sampled = texelFetch(state_texture, px, 0).rgb;
    open_frac = sampled.z;
    if (frame.sun_now.w > 0.0) sun_frac = sampled.y;
#else
    open_frac = min(2.0 * texelFetch(occlusion_texture, px, 0).r, 1.0) * 0.5 * (1.0 + n.z);
    if (frame.sun_now.w > 0.0) sun_frac = texelFetch(sun_now_texture, px, 0).r;
#endif
    vec4 start = material_start(int(ids.x));
    emissivity = material_band_emissivity(int(ids.x));
    if (start.z > 0.5) {
      temperature_k = frame.obscurance.y + start.y;
    } else {
#if defined(EMIT_CACHED)
      temperature_k = frame.obscurance.y + sampled.x;
#elif defined(EMIT_FOSTER)
      vec4 x = texelFetch(state_texture, px, 0);
      temperature_k = frame.obscurance.y + (start.w + ((x.x + x.y) + (x.z + x.w)));
#else
      vec2 x = texelFetch(state_texture, px, 0).rg;
      // Weights are the same in every interval: those of the first are read.
      float weight0_frac = relaxation_mode(int(ids.x), 0).z;
      float weight1_frac = relaxation_mode(int(ids.x), 1).z;
      temperature_k = frame.obscurance.y + (weight0_frac * x.x + weight1_frac * x.y);
#endif
    }
    atomicAdd(stats.surface_px, 1u);
  }

  for (uint i = 0u; i < frame.bands.x; ++i) {
    float radiance_w_m2_sr;
    if (surface) {
      vec4 lut = vec4(bands[i].lut_first_k, bands[i].lut_nodes_per_k, bands[i].lut_last_node, float(i * frame.bands.y));
      float emissivity_frac = emissivity[i];
      float emitted = emissivity_frac * planck_lut_radiance_w_m2_sr(temperature_k, lut, clamped);
      // Diffuse reflection: the open part of the hemisphere shows sky, the rest the surroundings.
      float incoming = mix(bands[i].surroundings_radiance_w_m2_sr, bands[i].sky_hemisphere_w_m2_sr, open_frac);
      incoming += bands[i].sun_irradiance_w_m2 / EMIT_PI * sun_frac * max(dot(n, frame.sun_now.xyz), 0.0);
      float leaving = emitted + (1.0 - emissivity_frac) * incoming;
      if (bands[i].atmosphere_table.z > 0u) {
        vec2 air = atmosphere_table_air(bands[i].atmosphere_table, boresight_m * ray_length, ray.z / ray_length, clamped);
        radiance_w_m2_sr = air.x * leaving + air.y;
      } else {
        float tau = transmittance(i, boresight_m * ray_length);
        radiance_w_m2_sr = tau * leaving + (1.0 - tau) * bands[i].air_radiance_w_m2_sr;
      }
    } else if (bands[i].atmosphere_table.z > 0u) {
      radiance_w_m2_sr = atmosphere_table_out(bands[i].atmosphere_table, ray.z / ray_length, clamped).y;
    } else {
      radiance_w_m2_sr = sky_radiance_w_m2_sr(i, ray.z / ray_length);
    }
    if (isnan(radiance_w_m2_sr) || isinf(radiance_w_m2_sr)) {
      nonfinite = true;
      radiance_w_m2_sr = 0.0;
    }
    planes[i * plane_px + pixel] = radiance_w_m2_sr;
  }

  uint plane = frame.bands.x;
  if ((frame.format_px.w & EMIT_OUTPUT_TEMPERATURE) != 0u) planes[plane++ * plane_px + pixel] = temperature_k;
  if ((frame.format_px.w & EMIT_OUTPUT_DEPTH) != 0u) {
    planes[plane++ * plane_px + pixel] = surface ? boresight_m : uintBitsToFloat(0x7f800000u);
  }
  if ((frame.format_px.w & EMIT_OUTPUT_OBJECT) != 0u) planes[plane++ * plane_px + pixel] = float(ids.y);
  if (nonfinite) atomicAdd(stats.nonfinite_px, 1u);
  if (clamped) atomicAdd(stats.clamped_px, 1u);
}
