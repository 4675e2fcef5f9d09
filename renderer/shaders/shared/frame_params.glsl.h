// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "shared/bindings.glsl.h"
#include "shared/cpp_glsl.glsl.h"
// "relworld": world axes (east, north, up), origin at the camera, metres.
EMIT_SHARED_BEGIN

struct FrameParams {
  mat4 relworld_from_sensor;  // rotation
  vec4 ray;                   // tangents in the sensor's axes: xy = per pixel, zw = at the corner of pixel 0
  uvec4 format_px;            // rendered: width, height, pixels per plane
  uvec4 picture_px;           // what is sent: the same, larger where fewer pixels are rendered
  uvec4 format_window_px;     // what is wanted of format_px: first column, first row, behind the last ones
  uvec4 picture_window_px;    // likewise, of picture_px
  vec4 obscurance;            // x = radius in m; y = reference temperature of offsets in K;
                              // foster: z = tolerance of a step in K, w = nodes per axis of the spin-up table
  uvec4 bands;                // x = nodes of a band's table, y = place of the emissivities behind the tables
  vec4 samples;               // cached: x = way of now between the two nodes of the samples, 0..1;
                              // y = boresight distance where the depth buffer holds 1, m
  vec4 sun_now;               // xyz = unit vector towards the sun, w = 1 if it is up
};

// One drawn instance of a mesh's submesh.
struct DrawParams {
  mat4 clip_from_mesh;         // reversed z, infinite far plane; image row 0 at NDC y = -1
  vec4 normal_from_mesh[3];    // columns; xyz = cofactors of relworld_from_mesh: right for unequal scales too
  uvec4 ids;                   // x = material, y = 1 + index of the scenario's object, z = 1 if that is an entity
};

// Three texels of the material table.
struct MaterialParams {
  float solar_absorptance_frac;
  float emissivity_frac;
  float conductance_w_m2_k;   // lambda / d of Eq. 5
  float base_k;
  float initial_offset_k;     // surface at history start, minus the reference temperature
  float prescribed_offset_k;  // if prescribed
  float prescribed;           // 1: temperature is given; 0: simulated
  float base_offset_k;        // foster: base minus the reference temperature
  vec4 resistance_m2k_w;      // foster: of the modes
};

// One light frustum of a history step: light coordinates in metres.
struct CascadeParams {
  vec4 light_row0;  // dot(row, vec4(p_relworld, 1)) = metres from the map's left edge
  vec4 light_row1;  // ... from its first row
  vec4 light_row2;  // ... behind the light's near plane
  vec4 scale;       // x, y = 1 / extent; z = 1 / depth range; w = boresight distance where it ends
  vec4 drift;       // xy = way of a shadow over the interval per metre between blocker and receiver
};

// Disc samples of the soft shadows: xy = place in the unit disc, z = place along the drift (-0.5..0.5),
// w = share of the greatest blocker distance that a search tap assumes for its drift.
struct TapParams {
  vec4 blocker[EMIT_MAX_TAPS];
  vec4 filter_[EMIT_MAX_TAPS];
};

// One interval of the thermal history; "start" and "end" are its two ends.
struct StepParams {
  CascadeParams cascades[EMIT_MAX_CASCADES];
  vec4 sun_start;   // xyz = unit vector towards the sun, w = direct normal flux after clouds, W m-2
  vec4 sun_end;
  vec4 flux_start;  // x = S_i, y = R_LW, z = exitance of the surroundings (R_e / emissivity), W m-2
  vec4 flux_end;    // foster: x = diffuse, y = sky long-wave, both horizontal; z, w = reflected sun and
                    // exitance of the surroundings
  vec4 film_air;    // foster: film coefficient in W m-2 K-1 and air offset in K at the start, at the end
  vec4 casters;     // x = height of the highest caster above the camera, m; y = sine of the sun's elevation
  uvec4 info;       // x = number of cascades; y = offset into relaxation table; z = EMIT_STEP_* flags
};

// Two texels of the relaxation table: exact exponential step of one material over one interval (lib/relaxation.glsl).
// foster: one entry per split of the interval; gains of four modes at the start, at the end (lib/foster.glsl).
struct RelaxationParams {
  vec4 mode0;  // gain of the drive at the start, at the end, weight of the mode, 0
  vec4 mode1;
};

struct BandParams {
  vec4 terms_amplitude_frac;
  vec4 terms_extinction_per_m;
  float air_radiance_w_m2_sr;          // blackbody at air temperature
  float surroundings_radiance_w_m2_sr; // blackbody at environment temperature
  float sky_hemisphere_w_m2_sr;        // cosine-weighted mean over the sky
  float vertical_transmittance_frac;   // ground to space
  float sun_irradiance_w_m2;           // in band, normal to the sun, at the ground
  float lut_first_k;                   // layout of the band's T ln L table
  float lut_nodes_per_k;
  float lut_last_node;
  uvec4 atmosphere_table;              // lib/atmosphere_table.glsl: first float, ranges, elevations; z = 0: none
};


// Counters of one frame, written with atomics.
struct FrameStatsGpu {
  uint flagged_px[4];  // by EMIT_FLAG_*; of a pixel with both, at their sum
};

EMIT_SHARED_END
