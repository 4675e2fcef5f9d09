// SPDX-License-Identifier: Apache-2.0
// Structs that C++ fills for each frame and that shaders read.
//
// "relworld" is a frame of reference: the axes of the world (east, north, up) with the origin at the camera, in metres.
// The "rendered image" holds the pixels that the passes compute. The "output image" holds the pixels that leave the
// renderer. It is larger than the rendered image where a quality level renders fewer pixels. A member that one thermal
// model or method alone uses names it: emit2014, foster (thermal.model), cached (thermal.method).
#pragma once
#include "shared/bindings.glsl.h"
#include "shared/cpp_glsl.glsl.h"
EMIT_SHARED_BEGIN

// Uniform block of one frame.
struct FrameParams {
  mat4 relworld_from_sensor;  // rotation only
  vec2 ray_per_px;            // step of a view ray's tangents to the next column and row, sensor axes
  vec2 ray_at_corner;         // tangents at the outer corner of pixel (0, 0), sensor axes
  uvec2 rendered_px;          // columns and rows of the rendered image
  uint rendered_plane_px;     // number of its pixels
  float sensor_height_m;      // above sea level
  uvec2 output_px;            // columns and rows of the output image
  uint output_plane_px;       // number of its pixels
  uint first_emissivity_sd;   // clutter: index of the first change of an emissivity in the buffer of the tables
  uvec4 rendered_window_px;   // requested part of the rendered image: first column, first row, end column, end row
  uvec4 output_window_px;     // the same part of the output image, in its pixels
  float obscurance_radius_m;
  float reference_k;          // temperature from which all offsets on the device count
  float step_tolerance_k;     // foster: error at which the splitting of an interval stops
  uint spin_up_nodes;         // foster: nodes per axis of the spin-up table
  uint band_lut_nodes;        // nodes of the T ln L table of one band
  uint first_emissivity;      // index of the first emissivity in the buffer of the tables
  float node_frac;            // cached: position of the frame between the two nodes of the samples, 0..1
  float near_m;               // cached: boresight distance at which the depth buffer holds 1
  vec3 to_sun;                // unit vector towards the sun, relworld
  float sun_up;               // 1: the sun is up; 0: it is not
  vec2 sun_at_px;             // middle of the sun's disc in the rendered image, in pixels from its corner
  float sun_radius_px;        // 0: the sun is out of view
  float moon_radius_px;       // 0: the moon is out of view
  vec2 moon_at_px;
  float moon_sun_au;          // distance of the moon from the sun
  float node_bow;             // cached: share that the frame takes of the samples' bow between the nodes
  vec3 moon_to_sun;           // unit vector: right and down in the image, then towards the camera
  float fog_above_m;          // fog: height of its top above the camera
  float fog_k;                // fog: its temperature
  float unused1;
  float unused2;
  float unused3;
};

// Uniform block of one draw: one submesh of one instance.
struct DrawParams {
  mat4 clip_from_mesh;       // reversed depth, infinite far plane; row 0 of the image lies at NDC y = -1
  // Columns in xyz: the cofactors of relworld_from_mesh, which hold for unequal scales too. cached: w is a component of
  // the unit vector to the zenith in the body frame of an entity.
  vec4 normal_from_mesh[3];
  uint material;
  uint object;               // 1 + index of the scenario's object
  uint moves;                // 1: the object is an entity; 0: it is static
  float moved_frac;          // cached: EntityStand::moved_frac of an entity
  vec4 tile_row[3];          // clutter: dot(row, vec4(p_mesh, 1)) is a coordinate that counts tiles of the field
  uint field;                // clutter: 1 + number of the field; 0: the material does not vary
  float twins;               // clutter: 1: the samples have twins; 0: their temperature does not vary
  uint unused0;
  uint unused1;
};

// Six texels of the material table.
struct MaterialParams {
  float solar_absorptance_frac;
  float emissivity_frac;
  float conductance_w_m2_k;   // lambda / d of physics.md eq. 4
  float base_k;
  float initial_offset_k;     // surface temperature at the start of the history minus the reference temperature
  float prescribed_offset_k;  // prescribed temperature minus the reference temperature
  float prescribed;           // 1: the temperature is prescribed; 0: it is simulated
  float base_offset_k;        // foster: base temperature minus the reference temperature
  vec4 resistance_m2k_w[EMIT_FOSTER_TEXELS];  // foster: resistance of each mode
  float roughness;            // foster: factor of the forced part of the film
  float wetness_frac;         // foster: share of the surface's potential evaporation; 0: dry
  float resistance_s_m;       // foster: resistance to evaporation in sunlight
  float night_resistance_s_m; // foster: the same without sunlight
  float leaf_forced;          // foster: what leaves add to the forced part of the film; 0: no leaves
  float leaf_natural;         // foster: the same of the natural part
  float unused0;
  float unused1;
};

// One light frustum of a history interval. Its coordinates are in metres.
struct CascadeParams {
  vec4 light_row0;        // dot(row, vec4(p_relworld, 1)) is the distance from the left edge of the map
  vec4 light_row1;        // the same product is the distance from the first row of the map
  vec4 light_row2;        // the same product is the depth behind the near plane of the light
  vec3 scale_per_m;       // 1 / extent of the frustum: across, down, in depth
  float end_boresight_m;  // the frustum serves receivers up to this boresight distance
  vec2 drift_frac;        // shift of a shadow over the interval per metre between blocker and receiver: across, down
  vec2 unused0;
};

// Samples of the sun's disc for the soft shadows: xy = position in the unit disc, z = position along the drift
// (-0.5..0.5), w = share of the largest possible blocker distance that a search tap assumes for its drift.
struct TapParams {
  vec4 blocker[EMIT_MAX_TAPS];
  vec4 filter_[EMIT_MAX_TAPS];
};

// Air past a surface at an instant, the twin of physics::AirFilm (physics.md eq. 31 to 35).
struct FilmParams {
  vec3 upwind;              // unit vector to where the wind comes from, world axes; 0: not known
  float directed_frac;      // share of the wind whose direction is known
  float windward_w_m2_k;    // forced part on a smooth windward face
  float leeward_w_m2_k;     // forced part on a smooth leeward face
  float vertical_root;      // natural part of a vertical face: (root + rise |dT|^1/6)^2
  float vertical_rise;
  float unstable_quarter;   // natural part of a level face over unstable air: factor of |dT|^1/4
  float unstable_third;     // factor of |dT|^1/3; the greater one counts
  float stable_quarter;     // the same over stable air: factor of |dT|^1/4
  float rough_frac;         // share of the material's roughness that counts
  float stated_w_m2_k;      // film that the user gave, multiplied by its share
  float model_frac;         // share of the model in the rest
  float leaf_forced;        // forced part on one side of a leaf of 1 m
  float leaf_quarter;       // its natural part: factor of |dT|^1/4
};

// Moisture of the air at an instant, the twin of physics::MoistAir (physics.md eq. 47).
struct MoistAirParams {
  float vapour_pa;
  float psychrometric_pa_k;
  float heat_j_m3_k;
  float stomata_w_m2;  // short-wave irradiance that opens stomata
};

// Uniform block of one interval of the thermal history. "start" and "end" are its two ends.
struct StepParams {
  CascadeParams cascades[EMIT_MAX_CASCADES];
  vec3 to_sun_start;              // unit vector towards the sun, relworld
  float sun_start_w_m2;           // direct normal flux below the clouds
  vec3 to_sun_end;
  float sun_end_w_m2;
  float diffuse_start_w_m2;       // emit2014: S_i of physics.md eq. 1; foster: diffuse flux on a level surface
  float longwave_start_w_m2;      // emit2014: R_LW of physics.md eq. 1; foster: long-wave sky flux on a level surface
  float reflected_start_w_m2;     // foster: sunlight that the surroundings reflect
  float environment_start_w_m2;   // long-wave exitance of the surroundings; emit2014: R_e / emissivity
  float diffuse_end_w_m2;
  float longwave_end_w_m2;
  float reflected_end_w_m2;
  float environment_end_w_m2;
  FilmParams film_start;          // foster: film coefficient
  FilmParams film_end;
  MoistAirParams moist_start;     // foster: moisture of the air
  MoistAirParams moist_end;
  float air_start_offset_k;       // foster: air temperature minus the reference temperature
  float air_end_offset_k;
  float casters_top_m;            // height of the highest caster above the camera
  float casters_sun_sine;         // sine of the sun's elevation at the sample of the interval
  uint cascade_count;             // entries of `cascades`; 0: nothing can be shaded
  uint relaxation_offset;         // first entry of the interval in the relaxation table
  uint flags;                     // EMIT_STEP_*
  uint unused2;
};

// Two texels of the relaxation table.
// emit2014: the exact step of one material over one interval (lib/relaxation.glsl). A texel belongs to a mode and holds
// the gain of the drive at the start, the gain at the end, the weight of the mode, 0.
// foster: EMIT_FOSTER_TEXELS entries per split of the interval (lib/foster.glsl). `first` holds the gains of four modes
// for the flux at the start, `second` those for the flux at the end. One entry follows them: `first` and `second` hold
// the share of open, level ground that rain has wetted, at the start and the end of the interval, and zeros.
struct RelaxationParams {
  vec4 first;
  vec4 second;
};

// Uniform block entry of one spectral band.
struct BandParams {
  vec4 terms_amplitude_frac;            // exponential terms of the air's transmittance
  vec4 terms_extinction_per_m;
  float air_radiance_w_m2_sr;           // blackbody at air temperature
  float surroundings_radiance_w_m2_sr;  // blackbody at the temperature of the surroundings
  float curvature_k;                    // L'' / L' of the blackbody is curvature_k / T^2 - 2 / T
  float vertical_transmittance_frac;    // ground to space
  float sun_irradiance_w_m2;            // in band, normal to the sun, at the ground
  float lut_first_k;                    // temperature of the first node of the band's T ln L table
  float lut_nodes_per_k;
  float lut_last_node;
  uint air_table_first;                 // index of the first float of the air's table (lib/atmosphere_table.glsl)
  uint air_table_ranges;
  uint air_table_elevations;            // 0: the band has no table of the air
  uint air_view_first;                  // index of the first node of the built-in air (lib/air_view.glsl)
  float sky_air_radiance_w_m2_sr;       // blackbody as warm as the air of the sky
  float cloud_cover_frac;               // share of the sky that even clouds cover
  float fog_per_m;                      // fog: extinction of what surfaces, sun and moon send
  uint air_sun_first;                   // index of the first node of the air's scattered sunlight; 0: there is none
  float sun_disc_w_m2_sr;               // radiance of the sun: outside the air if that is built in, else as seen
  float moon_through_frac;              // share of the moon's light that clouds leave, and other air than the built-in one
  float moon_reflected_w_m2_sr;         // sunlight that the moon sends from where the sun stands in the zenith
  float fog_wide_per_m;                 // fog: extinction of what the sky sends
  vec4 fog_light_w_m2_sr;               // fog: physics::FogLight, its blackbody, sky, ground and sun
  vec4 fog_rates;                       // fog: its two rates by height in m-1, the layer's depth over the ground, 0
  vec4 sky_by_tilt_w_m2_sr[EMIT_SKY_TILT_VEC4];  // mean of the sky that a face sees, see lib/sky_tilt.glsl
  vec4 cloud_w_m2_sr[EMIT_SKY_ELEVATION_VEC4];   // clouds by elevation with the air before them, at its nodes of the sky
};

// Uniform block of broken clouds (passes/clouds.glsl). Heights and places are those of the layer as it lies in the frame.
struct CloudParams {
  vec4 tiles_per_m;         // change of a place in tiles per metre to the east (xy) and to the north (zw)
  vec2 camera_tile;         // the layer above the camera
  vec2 sun_tile;            // where the sun's ray from the ground below the camera meets the layer
  vec2 sun_tiles_per_m_up;  // change of that with the height of the point
  float camera_m;           // height of the camera above the world's origin
  float above_m;            // height of the layer above the camera; not above 0: it lies below
  float gain;               // physics::CloudLight
  float depth;
  float texels_per_m;
  float unused0;
};

// Counters of one frame. Shaders add to them with atomics.
struct FrameStatsGpu {
  uint flagged_px[4];  // pixels by EMIT_FLAG_*; a pixel with both flags counts at the sum of the two
};

#ifdef __cplusplus
static_assert(sizeof(FrameParams) == 256);
EMIT_SHARED_OFFSET(FrameParams, ray_per_px, 64);
EMIT_SHARED_OFFSET(FrameParams, rendered_px, 80);
EMIT_SHARED_OFFSET(FrameParams, output_px, 96);
EMIT_SHARED_OFFSET(FrameParams, rendered_window_px, 112);
EMIT_SHARED_OFFSET(FrameParams, output_window_px, 128);
EMIT_SHARED_OFFSET(FrameParams, obscurance_radius_m, 144);
EMIT_SHARED_OFFSET(FrameParams, band_lut_nodes, 160);
EMIT_SHARED_OFFSET(FrameParams, to_sun, 176);
EMIT_SHARED_OFFSET(FrameParams, sun_up, 188);
EMIT_SHARED_OFFSET(FrameParams, moon_at_px, 208);
EMIT_SHARED_OFFSET(FrameParams, moon_to_sun, 224);
EMIT_SHARED_OFFSET(FrameParams, fog_k, 240);
static_assert(sizeof(DrawParams) == 192);
EMIT_SHARED_OFFSET(DrawParams, material, 112);
EMIT_SHARED_OFFSET(DrawParams, tile_row, 128);
EMIT_SHARED_OFFSET(DrawParams, field, 176);
static_assert(sizeof(MaterialParams) == 96);
EMIT_SHARED_OFFSET(MaterialParams, initial_offset_k, 16);
EMIT_SHARED_OFFSET(MaterialParams, resistance_m2k_w, 32);
EMIT_SHARED_OFFSET(MaterialParams, roughness, 64);
EMIT_SHARED_OFFSET(MaterialParams, leaf_forced, 80);
static_assert(sizeof(CascadeParams) == 80);
EMIT_SHARED_OFFSET(CascadeParams, scale_per_m, 48);
EMIT_SHARED_OFFSET(CascadeParams, end_boresight_m, 60);
EMIT_SHARED_OFFSET(CascadeParams, drift_frac, 64);
static_assert(sizeof(TapParams) == 2 * EMIT_MAX_TAPS * 16);
static_assert(sizeof(FilmParams) == 64);
EMIT_SHARED_OFFSET(FilmParams, windward_w_m2_k, 16);
EMIT_SHARED_OFFSET(FilmParams, unstable_quarter, 32);
EMIT_SHARED_OFFSET(FilmParams, stated_w_m2_k, 48);
static_assert(sizeof(MoistAirParams) == 16);
static_assert(sizeof(StepParams) == 80 * EMIT_MAX_CASCADES + 256);
EMIT_SHARED_OFFSET(StepParams, to_sun_start, 80 * EMIT_MAX_CASCADES);
EMIT_SHARED_OFFSET(StepParams, to_sun_end, 80 * EMIT_MAX_CASCADES + 16);
EMIT_SHARED_OFFSET(StepParams, diffuse_start_w_m2, 80 * EMIT_MAX_CASCADES + 32);
EMIT_SHARED_OFFSET(StepParams, diffuse_end_w_m2, 80 * EMIT_MAX_CASCADES + 48);
EMIT_SHARED_OFFSET(StepParams, film_start, 80 * EMIT_MAX_CASCADES + 64);
EMIT_SHARED_OFFSET(StepParams, film_end, 80 * EMIT_MAX_CASCADES + 128);
EMIT_SHARED_OFFSET(StepParams, moist_start, 80 * EMIT_MAX_CASCADES + 192);
EMIT_SHARED_OFFSET(StepParams, moist_end, 80 * EMIT_MAX_CASCADES + 208);
EMIT_SHARED_OFFSET(StepParams, air_start_offset_k, 80 * EMIT_MAX_CASCADES + 224);
EMIT_SHARED_OFFSET(StepParams, cascade_count, 80 * EMIT_MAX_CASCADES + 240);
static_assert(sizeof(RelaxationParams) == 32);
static_assert(sizeof(BandParams) == 144 + 16 * (EMIT_SKY_TILT_VEC4 + EMIT_SKY_ELEVATION_VEC4));
EMIT_SHARED_OFFSET(BandParams, air_radiance_w_m2_sr, 32);
EMIT_SHARED_OFFSET(BandParams, sun_irradiance_w_m2, 48);
EMIT_SHARED_OFFSET(BandParams, air_table_first, 64);
EMIT_SHARED_OFFSET(BandParams, sky_air_radiance_w_m2_sr, 80);
EMIT_SHARED_OFFSET(BandParams, sun_disc_w_m2_sr, 96);
EMIT_SHARED_OFFSET(BandParams, fog_light_w_m2_sr, 112);
EMIT_SHARED_OFFSET(BandParams, sky_by_tilt_w_m2_sr, 144);
static_assert(sizeof(CloudParams) == 64);
EMIT_SHARED_OFFSET(CloudParams, camera_tile, 16);
EMIT_SHARED_OFFSET(CloudParams, camera_m, 40);
EMIT_SHARED_OFFSET(CloudParams, texels_per_m, 56);
static_assert(sizeof(FrameStatsGpu) == 16);
#endif

EMIT_SHARED_END
