// SPDX-License-Identifier: Apache-2.0
// Binding numbers, limits and flags of the GPU path, for C++ and GLSL.
#pragma once

// Uniform blocks. Every pixel reads them with the same index.
#define EMIT_BIND_FRAME 0
#define EMIT_BIND_STEP 1
#define EMIT_BIND_BANDS 2
#define EMIT_BIND_TAPS 3
#define EMIT_BIND_DRAW 4
#define EMIT_BIND_SHADE 5
#define EMIT_BIND_TARGETS 6
#define EMIT_BIND_GAS 7
#define EMIT_BIND_CLOUDS 8

// Shader storage blocks. Shaders write them.
#define EMIT_BIND_OUTPUT 0
#define EMIT_BIND_STATS 1
#define EMIT_BIND_TARGET_STATS 2
#define EMIT_BIND_GAS_TILES 3  // read only: there may be more tiles than texels of a buffer texture

// Texture units. A table that every pixel reads at its own index is a buffer texture, because software
// rasterisers fetch from it much faster than from a storage block.
#define EMIT_TEX_DEPTH 0
#define EMIT_TEX_NORMAL 1
#define EMIT_TEX_IDS 2
#define EMIT_TEX_SHADOW 3
#define EMIT_TEX_OCCLUSION 4
#define EMIT_TEX_STATE 5
#define EMIT_TEX_SUN_NOW 6
#define EMIT_TEX_MATERIALS 7
#define EMIT_TEX_RELAXATION 8
#define EMIT_TEX_BAND_LUT 9
#define EMIT_TEX_SPIN_UP 10
#define EMIT_TEX_SURFACE 11
#define EMIT_TEX_SCALED 12
#define EMIT_TEX_SHADE 13
#define EMIT_TEX_SHADE_TOP 14
#define EMIT_TEX_ENTITY_SHADOWS 15
#define EMIT_TEX_RESPONSE 16
#define EMIT_TEX_EXPOSURE_TILE_PARAMS 17
#define EMIT_TEX_ENTITY_SHADOW_PARAMS 18
#define EMIT_TEX_SHADE_TILES 19
#define EMIT_TEX_SHADE_LIST 20
#define EMIT_TEX_AIR 21
#define EMIT_TEX_TARGET_PLANES 22
#define EMIT_TEX_TARGET_ROWS 23
#define EMIT_TEX_INCOMING 24
#define EMIT_TEX_GAS_PUFFS 25
#define EMIT_TEX_CLUTTER 26
#define EMIT_TEX_CLUTTER_PIXELS 27
#define EMIT_TEX_CLOUDS 28

// Image units.
#define EMIT_IMG_OCCLUSION 0
#define EMIT_IMG_STATE 1
#define EMIT_IMG_SUN_NOW 2
#define EMIT_IMG_SURFACE 3

// Vertex attributes.
#define EMIT_ATTR_POSITION 0
#define EMIT_ATTR_NORMAL 1
#define EMIT_ATTR_ROW 2  // uses three locations: 2, 3 and 4
#define EMIT_ATTR_NODE_BEFORE 5
#define EMIT_ATTR_NODE_AFTER 6
#define EMIT_ATTR_SHADE 7
#define EMIT_ATTR_HULL 8
#define EMIT_ATTR_SEEN_BEFORE 9
#define EMIT_ATTR_SEEN_AFTER 10
#define EMIT_ATTR_LOW_BEFORE 11
#define EMIT_ATTR_LOW_AFTER 12
#define EMIT_ATTR_HIGH_BEFORE 13
#define EMIT_ATTR_HIGH_AFTER 14

#define EMIT_MAX_CASCADES 4
#define EMIT_MAX_BANDS 4
#define EMIT_SKY_TILTS 17  // nodes of the sky by tilt, in EMIT_SKY_TILT_VEC4 vectors
#define EMIT_SKY_TILT_VEC4 5
#define EMIT_SKY_ELEVATION_VEC4 12  // vectors that hold the nodes of the sky's elevations (lib/air_view.glsl)
#define EMIT_MAX_MODES 2
#define EMIT_MAX_ATMOSPHERE_TERMS 4
#define EMIT_MAX_TAPS 256
#define EMIT_MAX_MATERIALS 4096  // passes/surface_texel.glsl keeps 12 bits

// Small targets of a frame, samples along the longer side of the tile of each, and columns of pixels that a window may
// touch.
#define EMIT_MAX_TARGETS 32
#define EMIT_TARGET_SIDE 128u
#define EMIT_TARGET_COLUMNS 36u

// Puffs of gas of a frame, vectors of 128 bits with one bit per puff, pixels along the side of a tile that one work group
// draws, kinds of puffs, and a boresight distance that stands for no surface.
#define EMIT_MAX_GAS_PUFFS 256
#define EMIT_GAS_PUFF_BITS 2
#define EMIT_GAS_TILE 16u
#define EMIT_GAS_DISPATCH_COLUMNS 32768u  // tiles in a row of work groups
#define EMIT_GAS_SMALL 1u  // the image of the puff is a few pixels wide
#define EMIT_GAS_FLARE 2u  // it emits and absorbs nothing
// Small puffs that are thin or flares are averaged over a pixel one by one, over this many samples along its side times
// the rest of `kind`. The other small ones take part in the samples of the tile.
#define EMIT_GAS_SAMPLES_SHIFT 2u
#define EMIT_GAS_FAR_M 1e7f

// Clutter: different fields at most, texels along the edge of a tile, levels of a field, places in a pixel at which it
// is taken at most, and the value at which twins of samples are solved.
#define EMIT_CLUTTER_FIELDS 8
#define EMIT_CLUTTER_SIDE 1024
#define EMIT_CLUTTER_LEVELS 17
#define EMIT_CLUTTER_TAPS 8
#define EMIT_CLUTTER_TWIN_SD 1.5
// Steps of a place in a tile, of 24 bits.
#define EMIT_CLUTTER_PLACE_STEPS 16777215.0

// Clouds: texels along the edge of a tile, levels of the field, and places in a pixel of the sky at most.
#define EMIT_CLOUD_SIDE 1024
#define EMIT_CLOUD_LEVELS 11
#define EMIT_CLOUD_TAPS 8

// Boresight distance that the geometry buffer holds for a pixel without a surface.
#define EMIT_SKY_DEPTH_M 1e30f
#define EMIT_MOON_SUBSOLAR_K 394.0f  // physics::kMoonSubsolarK
#define EMIT_MOON_EMISSIVITY 0.95f   // physics::kMoonEmissivityFrac

// Bits of EMIT_OUTPUTS, which passes/radiance.comp is compiled with.
#define EMIT_OUTPUT_TEMPERATURE 1u
#define EMIT_OUTPUT_DEPTH 2u
#define EMIT_OUTPUT_OBJECT 4u
#define EMIT_OUTPUT_SUN 8u
#define EMIT_OUTPUT_SKY 16u
// Radiance that arrives at the surface, a plane for each band, then the material, three of its clutter, the normal and
// the glint of a glossy surface, and the clouds.
#define EMIT_OUTPUT_TERMS 32u

// Indices of FrameStatsGpu.flagged_px.
#define EMIT_FLAG_NONFINITE 1
#define EMIT_FLAG_CLAMPED 2

// Bits of StepParams.flags.
#define EMIT_STEP_FIRST 1u
#define EMIT_STEP_SUN_UP 2u
#define EMIT_STEP_SUN_NOW 4u
#define EMIT_STEP_UNSHADED 8u  // foster: the step lies before the history and takes the sun as unobstructed

// foster: the finest split of an interval has 2 to this power parts.
#define EMIT_FOSTER_LEVELS 6
// Texels of the material table per material.
#define EMIT_MATERIAL_TEXELS 6

// foster: texels of four floats that hold one number for each of up to six modes. The last two floats are 0.
#define EMIT_FOSTER_TEXELS 2
// foster: entries of the relaxation table per material: those of each split, and the wetness.
#define EMIT_FOSTER_ENTRIES ((EMIT_FOSTER_LEVELS + 1) * EMIT_FOSTER_TEXELS + 1)
