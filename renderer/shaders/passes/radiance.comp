// SPDX-License-Identifier: Apache-2.0
// Computes the in-band radiance at the aperture: emission and reflection of the surface through the atmosphere, and sky
// where there is no surface. It writes the planes that are read back. NaN and Inf are counted and replaced by zero.
// The scenario decides what the shader is compiled with:
//   EMIT_BANDS      number of bands
//   EMIT_AIR_TERMS  bit per band: the air is a sum of at most EMIT_TERMS exponential terms
//   EMIT_AIR_TABLE  bit per band: the air is a table
//   EMIT_AIR_MODEL  bit per band: the air is built in
//   EMIT_AIR_SUN    bit per band, if there are any: built-in air that scatters sunlight by day
//   EMIT_OUTPUTS    planes besides radiance, EMIT_OUTPUT_*
//   EMIT_CLUTTER    defined: some materials vary from place to place; EMIT_CLUTTER_EMISSIVITY: their emissivity too
//   EMIT_CLOUDS     defined: broken clouds shade the sun and stand in the sky
//   EMIT_FOG        defined: a layer of fog lies over the ground
//   EMIT_LOBES      index of the first number of the lobes, if there are glossy materials
//   EMIT_ROWS       number of blocks of 8 x 8 pixels, one below the other, that a work group computes
#include "passes/gbuffer.glsl"
#include "passes/tables.glsl"
#include "passes/surface_texel.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(std140, binding = EMIT_BIND_BANDS) uniform Bands { BandParams band_uniforms[EMIT_MAX_BANDS]; };
BandParams bands[EMIT_BANDS];  // copied once, like the parameters of the frame
layout(binding = EMIT_TEX_BAND_LUT) uniform samplerBuffer band_lut;
layout(std430, binding = EMIT_BIND_OUTPUT) writeonly buffer Planes { float planes[]; };
layout(std430, binding = EMIT_BIND_STATS) buffer Stats { FrameStatsGpu stats; };

#define EMIT_PLANCK_LUT(index) texelFetch(band_lut, index).r
#include "lib/planck_lut.glsl"
#include "lib/sky_disc.glsl"
// The tables of the air lie in the same buffer, behind those of the bands.
#define EMIT_ATMOSPHERE_TABLE(index) texelFetch(band_lut, index).r
#include "lib/atmosphere_table.glsl"
layout(binding = EMIT_TEX_AIR) uniform samplerBuffer air_nodes;
#define EMIT_AIR_VIEW(index) texelFetch(air_nodes, index)
#include "lib/air_view.glsl"
#ifdef EMIT_LOBES
#define EMIT_LOBE_TABLE(index) texelFetch(band_lut, EMIT_LOBES + (index)).r
#define EMIT_LOBE_SKY(index) texelFetch(air_nodes, index)
#include "lib/lobe.glsl"
#endif

#ifdef EMIT_CLOUDS
#include "passes/clouds.glsl"
#endif
#ifdef EMIT_FOG
#include "lib/fog.glsl"
#endif

// Surface that a pixel shows. For a pixel of the sky only `boresight_m` is used.
struct Seen {
  float boresight_m;
  float temperature_k;
  float open_frac;   // share of the hemisphere that shows sky, cosine-weighted
  float sun_cosine;  // cosine of the sun's incidence times the visible share of the sun
  uint material;
  uint object;
#ifdef EMIT_CLUTTER
  float clutter_sd;           // mean of the clutter's field over the pixel
  float clutter_k;            // what it adds to the temperature
  float clutter_variance_k2;  // variance of the temperature within the pixel
#endif
#ifndef EMIT_CACHED
  float normal_up;   // vertical component of the unit normal
#endif
};

#ifdef EMIT_CACHED
layout(binding = EMIT_TEX_SURFACE) uniform usampler2D surface_texture;
layout(binding = EMIT_TEX_INCOMING) uniform sampler2D incoming_texture;

#ifdef EMIT_CLUTTER
#include "passes/clutter.glsl"
#endif

// Reads what a pixel shows of the sampled surface.
Seen seen_at(ivec2 px) {
  uvec2 texel = texelFetch(surface_texture, px, 0).rg;
  // Convert the reversed depth. It is 0 where nothing was drawn; there the texel is left from an older frame.
  float depth = texelFetch(depth_texture, px, 0).r;
  float boresight_m = depth > 0.0 ? frame.near_m / depth : EMIT_SKY_DEPTH_M;
  uint object = (EMIT_OUTPUTS & EMIT_OUTPUT_OBJECT) != 0u ? texelFetch(ids_texture, px, 0).r : 0u;
#ifdef EMIT_CLUTTER
  Clutter clutter = clutter_at(px);
  return Seen(boresight_m, texel_temperature_k(texel) + clutter.shift_k, texel_open_frac(texel),
              texel_sun_cosine(texel), texel_material(texel), object, clutter.sd, clutter.shift_k,
              clutter.variance_k2);
#else
  return Seen(boresight_m, texel_temperature_k(texel), texel_open_frac(texel), texel_sun_cosine(texel),
              texel_material(texel), object);
#endif
}
#else
layout(binding = EMIT_TEX_OCCLUSION) uniform sampler2D occlusion_texture;
layout(binding = EMIT_TEX_STATE) uniform sampler2D state_texture;
layout(binding = EMIT_TEX_SUN_NOW) uniform sampler2D sun_now_texture;

// Surface temperature of a pixel in K, from the states of the thermal passes.
float temperature_at(ivec2 px, int material) {
  vec4 start = material_start(material);
  if (start.z > 0.5) return frame.reference_k + start.y;
#ifdef EMIT_FOSTER_GROUPS
  vec4 x = texelFetch(state_texture, px, 0);
  float sum_k = (x.x + x.y) + (x.z + x.w);
#if EMIT_FOSTER_GROUPS > 1
  vec4 more = texelFetch(state_texture, px + ivec2(0, textureSize(state_texture, 0).y / EMIT_FOSTER_GROUPS), 0);
  sum_k += (more.x + more.y) + (more.z + more.w);
#endif
  return frame.reference_k + (start.w + sum_k);
#else
  vec2 x = texelFetch(state_texture, px, 0).rg;
  // Read the weights of the first interval. They are the same in every interval.
  float weight0_frac = relaxation_mode(material, 0).z;
  float weight1_frac = relaxation_mode(material, 1).z;
  return frame.reference_k + (weight0_frac * x.x + weight1_frac * x.y);
#endif
}

// Reads what a pixel shows from the geometry buffer and the results of the thermal passes.
Seen seen_at(ivec2 px) {
  uvec2 ids = gbuffer_ids(px);
  vec3 n = gbuffer_normal(px);
  float open_frac = min(2.0 * texelFetch(occlusion_texture, px, 0).r, 1.0) * 0.5 * (1.0 + n.z);
  float sun_frac = frame.sun_up > 0.0 ? texelFetch(sun_now_texture, px, 0).r : 0.0;
  return Seen(gbuffer_depth_m(px), temperature_at(px, int(ids.x)), open_frac,
              sun_frac * max(dot(n, frame.to_sun), 0.0), ids.x, ids.y, n.z);
}
#endif
#if !defined(EMIT_CACHED) || defined(EMIT_LOBES)
#define EMIT_SKY_TILT(band, node) band_uniforms[band].sky_by_tilt_w_m2_sr[(node) >> 2][(node) & 3]
#include "lib/sky_tilt.glsl"
#endif

// Mean radiance that arrives at the surface of a pixel from everything but the sun, by band, W m-2 sr-1. The open part of
// the hemisphere shows sky, the rest the surroundings; samples know more of what they see.
vec4 incoming_w_m2_sr(ivec2 px, Seen seen) {
#ifdef EMIT_CACHED
  return texelFetch(incoming_texture, px, 0);
#else
  vec4 sum = vec4(0.0);
  vec2 tilt = sky_tilt_place(seen.normal_up);
  for (uint i = 0u; i < EMIT_BANDS; ++i) {
    sum[i] = mix(bands[i].surroundings_radiance_w_m2_sr, sky_at_tilt_w_m2_sr(i, tilt), seen.open_frac);
  }
  return sum;
#endif
}

// Relative air mass of Kasten and Young (1989), physics.md eq. 10: 1 at the zenith, 38 at the horizon.
float air_mass(float sin_elevation) {
  float elevation_deg = asin(clamp(sin_elevation, 0.0, 1.0)) * (180.0 / EMIT_PI);
  return 1.0 / (max(sin_elevation, 0.0) + 0.50572 * exp(-1.6364 * log(elevation_deg + 6.07995)));
}

// Band radiance of the sky in W m-2 sr-1, for air that is a sum of exponential terms.
float sky_radiance_w_m2_sr(uint band, float sin_elevation) {
  float log_vertical = log(max(bands[band].vertical_transmittance_frac, 1e-30));
  return bands[band].sky_air_radiance_w_m2_sr * (1.0 - exp(log_vertical * air_mass(sin_elevation)));
}

// Transmittance of the air over a range, 0..1, as a sum of exponential terms.
float transmittance(uint band, float range_m) {
  float sum = 0.0;
  for (int term = 0; term < EMIT_TERMS; ++term) {
    sum += bands[band].terms_amplitude_frac[term] * exp(-bands[band].terms_extinction_per_m[term] * range_m);
  }
  return sum;
}

// Place and size of the band's table of the air, as lib/atmosphere_table.glsl takes it.
uvec4 air_table(uint band) {
  return uvec4(bands[band].air_table_first, bands[band].air_table_ranges, bands[band].air_table_elevations, 0u);
}

// Temperature of an even surface that emits as much as a pixel in a band does, K. Radiance is averaged over the pixel, not
// temperature: to second order the mean is that of a warmer surface.
float emitting_k(uint band, Seen seen) {
#ifdef EMIT_CLUTTER
  float per_k = 1.0 / max(seen.temperature_k, 1.0);
  return seen.temperature_k + 0.5 * seen.clutter_variance_k2 * (bands[band].curvature_k * per_k - 2.0) * per_k;
#else
  return seen.temperature_k;
#endif
}

// Band radiance that leaves the surface, W m-2 sr-1: x = emission and reflection of `incoming`, y = reflected
// sunlight. Sets `clamped` where the temperature lies outside the table.
vec2 leaving_w_m2_sr(uint band, Seen seen, float incoming, inout bool clamped) {
  vec4 lut = vec4(bands[band].lut_first_k, bands[band].lut_nodes_per_k, bands[band].lut_last_node,
                  float(band * frame.band_lut_nodes));
  float emissivity_frac = texelFetch(band_lut, int(frame.first_emissivity + seen.material * EMIT_BANDS + band)).r;
#ifdef EMIT_CLUTTER_EMISSIVITY
  emissivity_frac += seen.clutter_sd * texelFetch(band_lut, int(frame.first_emissivity_sd + seen.material * EMIT_BANDS +
                                                                band)).r;
#endif
  float emitted = emissivity_frac * planck_lut_radiance_w_m2_sr(emitting_k(band, seen), lut, clamped);
  // Add the diffuse reflection.
  float sunlight = bands[band].sun_irradiance_w_m2 / EMIT_PI * seen.sun_cosine;
  return vec2(emitted + (1.0 - emissivity_frac) * incoming, (1.0 - emissivity_frac) * sunlight);
}

#ifdef EMIT_LOBES
// Finds what all bands share of the lobe of a pixel. The block is 0 where the surface is not glossy.
LobePixel lobe_of(ivec2 px, Seen seen, bool surface) {
  int block = surface ? int(EMIT_LOBE_TABLE(int(seen.material))) : 0;
  LobePixel none;
  none.block = 0;
  if (block == 0) return none;
  return lobe_pixel(block, gbuffer_normal(px), -normalize(view_ray(px)), frame.to_sun, seen.open_frac,
                    seen.sun_cosine);
}

// The same as leaving_w_m2_sr() for a glossy surface. `tilt` is the place of its face on the sky by tilt.
vec2 glossy_leaving_w_m2_sr(uint band, Seen seen, LobePixel lobe, vec2 tilt, float incoming, inout bool clamped) {
  vec4 lut = vec4(bands[band].lut_first_k, bands[band].lut_nodes_per_k, bands[band].lut_last_node,
                  float(band * frame.band_lut_nodes));
  float black = planck_lut_radiance_w_m2_sr(emitting_k(band, seen), lut, clamped);
  return lobe_leaving_w_m2_sr(band, lobe, black, incoming, sky_at_tilt_w_m2_sr(band, tilt),
                              bands[band].surroundings_radiance_w_m2_sr, bands[band].sun_irradiance_w_m2);
}
#endif

// Logarithm of the air's extinction for a surface at a temperature. Between 300 K, 800 K and the sun it is linear in 1 /
// T (physics.md section 11).
float log_extinction_at(vec4 sight, float temperature_k) {
  float inverse = 1.0 / max(temperature_k, 200.0);
  float warm = (1.0 / 300.0 - inverse) / (1.0 / 300.0 - 1.0 / 800.0);
  float hot = (1.0 / 800.0 - inverse) / (1.0 / 800.0 - 1.0 / 5772.0);
  return hot > 0.0 ? mix(sight.y, sight.z, min(hot, 1.0)) : mix(sight.x, sight.y, warm);
}

// Radiance at the aperture through built-in air, for a surface that sends `leaving` (as above). `sight` is the node of
// its line of sight.
float through_air_w_m2_sr(vec4 sight, vec2 leaving, float temperature_k, float range_m) {
  float thermal = air_view_transmittance(log_extinction_at(sight, temperature_k), range_m);
  return thermal * leaving.x + air_view_transmittance(sight.z, range_m) * leaving.y +
         air_view_path_w_m2_sr(sight, range_m);
}

// Radiance of the sun's disc in a pixel, of which it covers a share. `sight` is the node of the line of sight.
float sun_disc_w_m2_sr(uint band, vec4 sight, float cover_frac) {
  float through = (EMIT_AIR_MODEL >> band & 1u) != 0u ? exp(-sight.z) : 1.0;
  return cover_frac * through * bands[band].sun_disc_w_m2_sr;
}

// The same of the moon, whose middle lies at `centre` from that of the pixel.
float moon_disc_w_m2_sr(uint band, vec4 sight, vec2 centre, float cover_frac) {
  vec4 lut = vec4(bands[band].lut_first_k, bands[band].lut_nodes_per_k, bands[band].lut_last_node,
                  float(band * frame.band_lut_nodes));
  float sum = 0.0;
  float weights = 0.0;
  bool below_table = false;  // by night the moon is darker than the table; it is the table's first node there
  int side = disc_side(frame.moon_radius_px);
  for (int i = 0; i < side * side; ++i) {
    vec3 point = disc_point(i, side, centre, frame.moon_radius_px);
    vec3 normal = vec3(point.xy, sqrt(max(1.0 - dot(point.xy, point.xy), 0.0)));
    float cosine = max(dot(normal, frame.moon_to_sun), 0.0);
    float temperature_k = max(EMIT_MOON_SUBSOLAR_K * inversesqrt(frame.moon_sun_au) * sqrt(sqrt(cosine)), 100.0);
    sum += point.z * (EMIT_MOON_EMISSIVITY * planck_lut_radiance_w_m2_sr(temperature_k, lut, below_table) +
                      cosine * bands[band].moon_reflected_w_m2_sr);
    weights += point.z;
  }
  float through = (EMIT_AIR_MODEL >> band & 1u) != 0u ? exp(-sight.x) : 1.0;
  return cover_frac * through * bands[band].moon_through_frac * sum / weights;
}

#ifdef EMIT_FOG
// Air before fog that begins at a place on the line of sight: x = transmittance for what the fog sends, y = its own
// radiance. `sun_cosine` is that of the angle between the line of sight and the sun.
vec2 air_before_fog(uint band, float begin_m, float sin_elevation, float sun_cosine) {
  if (begin_m <= 0.0) return vec2(1.0, 0.0);
  if ((EMIT_AIR_MODEL >> band & 1u) != 0u) {
    AirPlace place = air_view_sight_place(frame.sensor_height_m + begin_m * sin_elevation, begin_m);
    vec4 sight = air_view_node(int(bands[band].air_view_first), place);
#ifdef EMIT_AIR_SUN
    if ((EMIT_AIR_SUN >> band & 1u) != 0u && bands[band].air_sun_first != 0u) {
      sight.w += air_sun_w_m2_sr(int(bands[band].air_sun_first), place, sun_cosine);
    }
#endif
    return vec2(air_view_transmittance(log_extinction_at(sight, frame.fog_k), begin_m),
                air_view_path_w_m2_sr(sight, begin_m));
  }
  if ((EMIT_AIR_TABLE >> band & 1u) != 0u) {
    bool off_table = false;  // what lies behind the fog counts the pixel
    return atmosphere_table_air(air_table(band), begin_m, sin_elevation, off_table);
  }
  if ((EMIT_AIR_TERMS >> band & 1u) == 0u) return vec2(1.0, 0.0);
  float tau = transmittance(band, begin_m);
  return vec2(tau, (1.0 - tau) * bands[band].air_radiance_w_m2_sr);
}
#endif

// Radiance of clouds in a band at a place of the sky, with the air before them.
float cloud_w_m2_sr(uint band, AirPlace sky) {
  int node = sky.low - kAirHeights * kAirRanges;
  return mix(band_uniforms[band].cloud_w_m2_sr[node >> 2][node & 3],
             band_uniforms[band].cloud_w_m2_sr[(node + 1) >> 2][(node + 1) & 3], sky.along);
}

// Computes and writes all planes of one pixel.
void write_pixel(ivec2 px) {
  // Leave pixels outside the window.
  if (any(greaterThanEqual(px, ivec2(frame.rendered_window_px.zw)))) return;
  uint pixel = uint(px.y) * frame.rendered_px.x + uint(px.x);
  uint plane_px = frame.rendered_plane_px;
  // Read what the pixel shows and the elevation of its line of sight.
  Seen seen = seen_at(px);
  vec4 incoming = incoming_w_m2_sr(px, seen);
  vec3 ray = sensor_ray(px);
  float ray_length = length(ray);
  vec3 up = vec3(frame.relworld_from_sensor[0].z, frame.relworld_from_sensor[1].z, frame.relworld_from_sensor[2].z);
  float sin_elevation = dot(up, ray) / ray_length;
  bool surface = seen.boresight_m < EMIT_SKY_DEPTH_M;
  float range_m = seen.boresight_m * ray_length;
#ifdef EMIT_CLOUDS
  // Find the sun that clouds leave at the surface, or the clouds in the sky.
  vec3 direction = mat3(frame.relworld_from_sensor) * ray / ray_length;
  float px_rad = abs(frame.ray_per_px.x) / ray_length;
  float cloud_away_m = cloud_range_m(direction.z);
  float cloud = surface ? cloud_sun(range_m * direction, range_m * px_rad / clamp(abs(direction.z), 0.125, 1.0))
                        : cloud_in_sky(direction, cloud_away_m, px_rad);
  if (surface) seen.sun_cosine *= cloud;
#else
  float cloud = surface ? 1.0 : 0.0;
#endif
  // All bands look up their built-in air at one place, whether it lies on a surface or in the sky.
  AirPlace sky_place = air_view_sky_place(sin_elevation);
  AirPlace air_place = sky_place;
  AirPlace sight_place = air_view_sight_place(frame.sensor_height_m + range_m * sin_elevation, range_m);
  if (surface) air_place = sight_place;
#if defined(EMIT_AIR_SUN) || defined(EMIT_FOG)
  float ray_sun_cosine = dot(frame.to_sun, mat3(frame.relworld_from_sensor) * ray) / ray_length;
#endif
  bool clamped = false;
  bool nonfinite = false;
#ifdef EMIT_LOBES
  LobePixel lobe = lobe_of(px, seen, surface);
  vec2 tilt = sky_tilt_place(lobe.block != 0 ? lobe.normal.z : 1.0);
#endif

  // Find the shares of a pixel of the sky that sun and moon cover. They are rarely in view.
  float sun_frac = 0.0;
  float moon_frac = 0.0;
  vec2 moon_centre = frame.moon_at_px - vec2(px) - 0.5;
  if (!surface && frame.moon_radius_px > 0.0) moon_frac = disc_cover_frac(moon_centre, frame.moon_radius_px);
  if (!surface && frame.sun_radius_px > 0.0) {
    // The moon hides the sun.
    sun_frac = disc_cover_frac(frame.sun_at_px - vec2(px) - 0.5, frame.sun_radius_px) * (1.0 - moon_frac);
  }
#ifdef EMIT_CLOUDS
  if (clouds.above_m > 0.0) sun_frac *= clouds.gain * (1.0 - clouds.depth * cloud);
  moon_frac *= 1.0 - cloud;
#endif
#ifdef EMIT_FOG
  vec2 fog = fog_stretch(frame.fog_above_m, sin_elevation, surface ? range_m : kFogFarM);
#endif

  // Compute the radiance of each band. Where both sides are cheap the code selects and does not branch, because
  // software rasterisers run both sides of a branch anyway.
  for (uint i = 0u; i < EMIT_BANDS; ++i) {
    bool off_table = false;
    vec2 leaving = leaving_w_m2_sr(i, seen, incoming[i], off_table);
#ifdef EMIT_LOBES
    if (lobe.block != 0) leaving = glossy_leaving_w_m2_sr(i, seen, lobe, tilt, incoming[i], off_table);
#endif
    clamped = clamped || (surface && off_table);
    float radiance_w_m2_sr = surface ? leaving.x + leaving.y : 0.0;
    vec4 sight = vec4(0.0);
    if ((EMIT_AIR_MODEL >> i & 1u) != 0u) {
      sight = air_view_node(int(bands[i].air_view_first), air_place);
#ifdef EMIT_AIR_SUN
      // Sunlight that the air scatters comes on top of what it emits.
      if ((EMIT_AIR_SUN >> i & 1u) != 0u && bands[i].air_sun_first != 0u) {
        sight.w += air_sun_w_m2_sr(int(bands[i].air_sun_first), air_place, ray_sun_cosine);
      }
#endif
      float seen_w_m2_sr = through_air_w_m2_sr(sight, leaving, seen.temperature_k, range_m);
      radiance_w_m2_sr = surface ? seen_w_m2_sr : sight.w;
    } else if ((EMIT_AIR_TABLE >> i & 1u) != 0u) {
      vec2 air = surface ? atmosphere_table_air(air_table(i), range_m, sin_elevation, clamped)
                         : atmosphere_table_out(air_table(i), sin_elevation, clamped);
      radiance_w_m2_sr = surface ? air.x * radiance_w_m2_sr + air.y : air.y;
    } else if ((EMIT_AIR_TERMS >> i & 1u) != 0u) {
      if (surface) {
        float tau = transmittance(i, range_m);
        radiance_w_m2_sr = tau * radiance_w_m2_sr + (1.0 - tau) * bands[i].air_radiance_w_m2_sr;
      } else {
        radiance_w_m2_sr = sky_radiance_w_m2_sr(i, sin_elevation);
      }
    }
    // Put clouds before the sky.
#ifdef EMIT_CLOUDS
    if (!surface) radiance_w_m2_sr = mix(radiance_w_m2_sr, cloud_w_m2_sr(i, sky_place), cloud);
#else
    if (!surface && bands[i].cloud_cover_frac > 0.0) {
      radiance_w_m2_sr = mix(radiance_w_m2_sr, cloud_w_m2_sr(i, sky_place), bands[i].cloud_cover_frac);
    }
#endif
    float discs_w_m2_sr = 0.0;
    if (sun_frac > 0.0) discs_w_m2_sr += sun_disc_w_m2_sr(i, sight, sun_frac);
    if (moon_frac > 0.0) discs_w_m2_sr += moon_disc_w_m2_sr(i, sight, moon_centre, moon_frac);
#ifdef EMIT_FOG
    // Put fog before everything (physics.md eq. 91).
    if (fog.y > 0.0) {
      float per_m = surface ? bands[i].fog_per_m : bands[i].fog_wide_per_m;
      float through = exp(-per_m * fog.y);
      float glow = fog_glow_w_m2_sr(bands[i].fog_light_w_m2_sr, bands[i].fog_rates.xyz, per_m,
                                    max(frame.fog_above_m, 0.0), sin_elevation, fog.y);
      vec2 air = air_before_fog(i, fog.x, sin_elevation, ray_sun_cosine);
      radiance_w_m2_sr = through * radiance_w_m2_sr + (1.0 - through) * air.y + air.x * glow;
      discs_w_m2_sr *= exp(-bands[i].fog_per_m * fog.y);
    }
#endif
    radiance_w_m2_sr += discs_w_m2_sr;
    bool finite = !(isnan(radiance_w_m2_sr) || isinf(radiance_w_m2_sr));
    nonfinite = nonfinite || !finite;
    planes[i * plane_px + pixel] = finite ? radiance_w_m2_sr : 0.0;
  }

  // Write the other planes that are asked for.
  uint plane = EMIT_BANDS;
  if ((EMIT_OUTPUTS & EMIT_OUTPUT_TEMPERATURE) != 0u) {
    planes[plane++ * plane_px + pixel] = surface ? seen.temperature_k : uintBitsToFloat(0x7fc00000u);
  }
  if ((EMIT_OUTPUTS & EMIT_OUTPUT_DEPTH) != 0u) {
    planes[plane++ * plane_px + pixel] = surface ? seen.boresight_m : uintBitsToFloat(0x7f800000u);
  }
  if ((EMIT_OUTPUTS & EMIT_OUTPUT_OBJECT) != 0u) {
    planes[plane++ * plane_px + pixel] = surface ? float(seen.object) : 0.0;
  }
  if ((EMIT_OUTPUTS & EMIT_OUTPUT_SUN) != 0u) {
    planes[plane++ * plane_px + pixel] = surface ? seen.sun_cosine : uintBitsToFloat(0x7fc00000u);
  }
  if ((EMIT_OUTPUTS & EMIT_OUTPUT_SKY) != 0u) {
    planes[plane++ * plane_px + pixel] = surface ? seen.open_frac : uintBitsToFloat(0x7fc00000u);
  }
  if ((EMIT_OUTPUTS & EMIT_OUTPUT_TERMS) != 0u) {
    for (uint i = 0u; i < EMIT_BANDS; ++i) planes[plane++ * plane_px + pixel] = surface ? incoming[i] : 0.0;
    planes[plane++ * plane_px + pixel] = surface ? float(seen.material) : 0.0;
#ifdef EMIT_CLUTTER
    planes[plane++ * plane_px + pixel] = surface ? seen.clutter_sd : 0.0;
    planes[plane++ * plane_px + pixel] = surface ? seen.clutter_k : 0.0;
    planes[plane++ * plane_px + pixel] = surface ? seen.clutter_variance_k2 : 0.0;
#else
    for (int i = 0; i < 3; ++i) planes[plane++ * plane_px + pixel] = 0.0;
#endif
    vec4 glossy = vec4(0.0);
#ifdef EMIT_LOBES
    if (lobe.block != 0) glossy = vec4(lobe.normal, lobe.glint_per_sr);
#endif
    for (int i = 0; i < 4; ++i) planes[plane++ * plane_px + pixel] = glossy[i];
    planes[plane++ * plane_px + pixel] = cloud;
  }
  // Count the pixel if it is flagged.
  int flags = (nonfinite ? EMIT_FLAG_NONFINITE : 0) + (clamped ? EMIT_FLAG_CLAMPED : 0);
  if (flags != 0) atomicAdd(stats.flagged_px[flags], 1u);
}

void main() {
  // Copy the uniforms once for all pixels of the invocation.
  read_frame();
  for (uint i = 0u; i < EMIT_BANDS; ++i) bands[i] = band_uniforms[i];
#ifdef EMIT_CLOUDS
  clouds = cloud_uniforms;
#endif
  // Write one pixel in each block of the work group.
  uvec2 first_px = gl_WorkGroupID.xy * uvec2(8u, 8u * EMIT_ROWS) + gl_LocalInvocationID.xy;
  ivec2 px = ivec2(first_px + frame.rendered_window_px.xy);
  for (uint row = 0u; row < EMIT_ROWS; ++row) write_pixel(px + ivec2(0, 8 * int(row)));
}
