// SPDX-License-Identifier: Apache-2.0
// Puts the shade of entities on static surfaces, where triangles are too large to show it. It changes the geometry
// buffer of the samples. Exposure tiles lower the temperature where entities have cast shade lately. Entity shadow depth
// maps reduce the sunlight where entities stand now. Work is done only in the screen tiles that some of them may reach,
// and each screen tile lists those that may reach it.
//   EMIT_ROWS  number of blocks of 8 x 8 pixels, one below the other, that a work group computes
#include "shared/shade_params.glsl.h"
#include "passes/gbuffer.glsl"
#include "passes/surface_texel.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(rg32ui, binding = EMIT_IMG_SURFACE) uniform uimage2D surface_image;
layout(std140, binding = EMIT_BIND_SHADE) uniform Shade { ShadeParams shade; };
layout(binding = EMIT_TEX_SHADE) uniform sampler2DArray exposure_texture;
layout(binding = EMIT_TEX_SHADE_TOP) uniform sampler2DArray tops_texture;
layout(binding = EMIT_TEX_ENTITY_SHADOWS) uniform sampler2DArray entity_shadows_texture;
layout(binding = EMIT_TEX_RESPONSE) uniform samplerBuffer response_table;
layout(binding = EMIT_TEX_EXPOSURE_TILE_PARAMS) uniform samplerBuffer exposure_tile_params;
layout(binding = EMIT_TEX_ENTITY_SHADOW_PARAMS) uniform samplerBuffer entity_shadow_params;
layout(binding = EMIT_TEX_SHADE_TILES) uniform usamplerBuffer shade_tiles;
layout(binding = EMIT_TEX_SHADE_LIST) uniform usamplerBuffer shade_list;

// Loops with at most one turn stand for branches here: software rasterisers run both sides of a branch, but leave a
// loop that no lane is in.

// Temperature in K that recent shade has taken off a surface that faces the sun, by exposure tile `tile` (physics.md
// eq. 25). `p` is the point in relworld axes.
float cooler_k(vec3 p, uint material, int tile) {
  // Follow the sun's ray from the point to the plane of the tile.
  // `place` is first_x_m, first_y_m, plane_m, texels_per_m.
  vec4 place = texelFetch(exposure_tile_params, tile * EMIT_EXPOSURE_TILE_TEXELS);
  float height_m = p.z - place.z;
  vec2 at = (p.xy - height_m * shade.slope - place.xy) * place.w;
  // Leave points outside the tile. Its own texels end half way to the texels of its rim.
  bool inside = all(greaterThanEqual(at, vec2(0.5))) && all(lessThan(at, vec2(float(EMIT_EXPOSURE_TILE_SIDE) - 1.5)));
  float sum_k = 0.0;
  for (int looks = inside ? 1 : 0; looks > 0; --looks) {
    // `range` is reach_m, lowest_m, layer.
    vec4 range = texelFetch(exposure_tile_params, tile * EMIT_EXPOSURE_TILE_TEXELS + 1);
    // Leave points above the height at which the shade began: they lie between the sun and the entity.
    float top_m = texelFetch(tops_texture, ivec3(ivec2(at + 0.5), int(range.z)), 0).r;
    // Weigh the modes of the response of the material.
    vec4 shaded = textureLod(exposure_texture, vec3((at + 0.5) / float(EMIT_EXPOSURE_TILE_SIDE), range.z), 0.0);
    vec4 left_frac = texelFetch(exposure_tile_params, tile * EMIT_EXPOSURE_TILE_TEXELS + 2);
    vec4 weight_k = texelFetch(response_table, int(material));
    bool reached = height_m <= min(range.x, top_m) && height_m >= range.y;
    sum_k = reached ? dot(weight_k, left_frac * shaded) : 0.0;
  }
  return sum_k;
}

// Share of the sun's disc that entity shadow depth map `shadow_map` leaves at the point `p` (relworld), 0..1.
float lit_frac(vec3 p, int shadow_map) {
  // Find the point on the map.
  int texel = shadow_map * EMIT_ENTITY_SHADOW_TEXELS;
  vec4 point = vec4(p, 1.0);
  vec2 at = vec2(dot(texelFetch(entity_shadow_params, texel), point),
                 dot(texelFetch(entity_shadow_params, texel + 1), point));
  float depth_m = dot(texelFetch(entity_shadow_params, texel + 2), point);
  // Compute the radius of the sun's disc on the map.
  vec4 penumbra = texelFetch(entity_shadow_params, texel + 3);  // mean_depth_m, penumbra_texels_per_m, layer
  float radius = max(0.5, (depth_m - penumbra.x) * penumbra.y);
  float side = float(textureSize(entity_shadows_texture, 0).x);
  bool within = all(greaterThan(at, vec2(-radius))) && all(lessThan(at, vec2(side + radius)));
  // Count the taps whose texel lies in front of the point.
  int taps = within ? EMIT_SHADE_TAPS : 0;
  float shaded = 0.0;
  for (int i = 0; i < taps; ++i) {
    vec4 both = shade.taps[i >> 1];
    vec2 place = floor(at + radius * ((i & 1) == 0 ? both.xy : both.zw));
    bool inside = all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(side)));
    float caster_m = texelFetch(entity_shadows_texture, ivec3(clamp(place, vec2(0.0), vec2(side - 1.0)), penumbra.z), 0).r;
    if (inside && depth_m > caster_m + EMIT_SHADE_LIFT_M) shaded += 1.0;
  }
  return 1.0 - shaded / float(EMIT_SHADE_TAPS);
}

// Applies the entries of a screen tile to one pixel.
void shade_pixel(ivec2 px, uvec4 tile) {
  // Read the surface of the pixel. Only a lit, static surface inside the window takes shade.
  bool seen = all(lessThan(px, ivec2(frame.rendered_window_px.zw)));
  float depth = seen ? texelFetch(depth_texture, px, 0).r : 0.0;
  uvec2 texel = imageLoad(surface_image, px).rg;
  vec3 p = view_ray(px) * (frame.near_m / depth);
  float sun_cosine = texel_sun_cosine(texel);
  bool lit = depth > 0.0 && !texel_moves(texel) && sun_cosine > 0.0;
  // Add up how much colder the exposure tiles make the surface.
  int first = int(tile.y);
  int behind_exposure_tiles = lit ? first + int(tile.z) : first;
  int last = lit ? behind_exposure_tiles + int(tile.w) : behind_exposure_tiles;
  float colder_k = 0.0;
  for (int i = first; i < behind_exposure_tiles; ++i) {
    colder_k += cooler_k(p, texel_material(texel), int(texelFetch(shade_list, i).r));
  }
  // Multiply the shares of the sun that the shadow depth maps leave. The texel holds the share that static surfaces
  // leave.
  float left_frac = 1.0;
  for (int i = behind_exposure_tiles; i < last; ++i) left_frac *= lit_frac(p, int(texelFetch(shade_list, i).r));
  // Write the pixel if it changed.
  if (colder_k == 0.0 && left_frac == 1.0) return;
  texel = packed_surface_texel(texel_temperature_k(texel) - sun_cosine * colder_k, left_frac * sun_cosine,
                               texel_open_frac(texel), texel_material(texel), false);
  imageStore(surface_image, px, uvec4(texel, 0u, 0u));
}

void main() {
  // Find the screen tile of the work group and its first pixel.
  read_frame();
  uvec4 tile = texelFetch(shade_tiles, int(gl_WorkGroupID.z));
  uvec2 first_px = uvec2(tile.x & 0xffffu, tile.x >> 16) + gl_WorkGroupID.xy * uvec2(8u, 8u * EMIT_ROWS);
  ivec2 px = ivec2(first_px + gl_LocalInvocationID.xy);
  for (int row = 0; row < int(EMIT_ROWS); ++row) shade_pixel(px + ivec2(0, 8 * row), tile);
}
