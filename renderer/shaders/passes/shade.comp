// SPDX-License-Identifier: Apache-2.0
// Shade of entities on what stands still, where triangles are too large for it: changes the geometry buffer of
// samples. With EMIT_PAGES the temperature, by what entities have shaded lately; else the sunlight, by where
// they stand now.
#include "shared/shade_params.glsl.h"
#include "passes/gbuffer.glsl"
#include "passes/surface_texel.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(rg32ui, binding = EMIT_IMG_SURFACE) uniform uimage2D surface_image;

#ifdef EMIT_PAGES
layout(std140, binding = EMIT_BIND_SHADE) uniform Shade { PageParams shade; };
layout(binding = EMIT_TEX_SHADE) uniform sampler2DArray pages_texture;
layout(binding = EMIT_TEX_RESPONSE) uniform samplerBuffer response_table;
layout(binding = EMIT_TEX_SHADE_TOP) uniform sampler2DArray tops_texture;
#else
layout(std140, binding = EMIT_BIND_SHADE) uniform Shade { SilhouetteParams shade; };
layout(binding = EMIT_TEX_SHADE) uniform sampler2DArray silhouettes_texture;
#endif

void main() {
  ivec2 px = ivec2(gl_GlobalInvocationID.xy + shade.px.xy);
  if (any(greaterThanEqual(px, ivec2(shade.px.zw)))) return;
  float depth = texelFetch(depth_texture, px, 0).r;
  uvec2 texel = imageLoad(surface_image, px).rg;
  if (!(depth > 0.0) || texel_moves(texel)) return;
  vec3 p = view_ray(px) * (frame.samples.y / depth);
  float sun_cosine = texel_sun_cosine(texel);
#ifdef EMIT_PAGES
  float height_m = p.z - shade.place.z;
  if (height_m > shade.sun.z || height_m < shade.lowest_m.x) return;
  vec2 at = (p.xy - height_m * shade.sun.xy - shade.place.xy) * shade.place.w;
  // Own texels end half way to those of the rim.
  if (any(lessThan(at, vec2(0.5))) || any(greaterThanEqual(at, vec2(float(EMIT_PAGE_SIDE) - 1.5)))) return;
  vec4 shaded = textureLod(pages_texture, vec3((at + 0.5) / float(EMIT_PAGE_SIDE), shade.sun.w), 0.0);
  vec4 weight_k = texelFetch(response_table, int(texel_material(texel)));
  // What lies between the sun and the entity takes nothing of it.
  float top_m = texelFetch(tops_texture, ivec3(ivec2(at + 0.5), int(shade.sun.w)), 0).r;
  if (shaded == vec4(0.0) || sun_cosine == 0.0 || height_m > top_m) return;
  float cooler_k = sun_cosine * dot(weight_k, shade.left_frac * shaded);
  texel = packed_surface_texel(texel_temperature_k(texel) - cooler_k, sun_cosine, texel_open_frac(texel),
                               texel_material(texel), false);
#else
  vec4 point = vec4(p, 1.0);
  vec2 at = vec2(dot(shade.column, point), dot(shade.row, point));
  float depth_m = dot(shade.depth_m, point);
  float radius = max(0.5, (depth_m - shade.penumbra.x) * shade.penumbra.y);
  float side = float(textureSize(silhouettes_texture, 0).x);
  bool within = all(greaterThan(at, vec2(-radius))) && all(lessThan(at, vec2(side + radius)));
  // Software rasterisers run what follows a return all the same, but leave loops that nobody is in.
  int taps = within && sun_cosine > 0.0 ? EMIT_SHADE_TAPS : 0;
  float shaded = 0.0;
  for (int i = 0; i < taps; ++i) {
    vec4 both = shade.taps[i >> 1];
    vec2 place = floor(at + radius * ((i & 1) == 0 ? both.xy : both.zw));
    bool inside = all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(side)));
    float caster_m = texelFetch(silhouettes_texture, ivec3(clamp(place, vec2(0.0), vec2(side - 1.0)), shade.penumbra.z), 0).r;
    if (inside && depth_m > caster_m + EMIT_SHADE_LIFT_M) shaded += 1.0;
  }
  if (shaded == 0.0) return;
  float lit_frac = 1.0 - shaded / float(EMIT_SHADE_TAPS);
  texel = packed_surface_texel(texel_temperature_k(texel), lit_frac * sun_cosine, texel_open_frac(texel),
                               texel_material(texel), false);
#endif
  imageStore(surface_image, px, uvec4(texel, 0u, 0u));
}
