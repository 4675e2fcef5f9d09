// SPDX-License-Identifier: Apache-2.0
// Reads the layer of broken clouds (physics.md section 16): the direct sun at a surface, and clouds in the sky. Levels of
// the field lie below each other in the texture; level l has SIDE >> l texels along a side and begins at row 2 SIDE -
// (2 SIDE >> l). The twin on the CPU is physics::CloudField.
layout(std140, binding = EMIT_BIND_CLOUDS) uniform Clouds { CloudParams cloud_uniforms; };
layout(binding = EMIT_TEX_CLOUDS) uniform sampler2D cloud_field;
CloudParams clouds;  // copied once, like the parameters of the frame

const float kCloudEarthRadiusM = 6371000.0;  // physics::kCloudEarthRadiusM

// Opacity at a place in tiles, bilinear between the texels of a level.
float cloud_texels(int level, vec2 tile) {
  int side = EMIT_CLOUD_SIDE >> level;
  vec2 texel = fract(tile) * float(side) - 0.5;
  vec2 corner = floor(texel);
  vec2 part = texel - corner;
  ivec2 low = ivec2(corner) & (side - 1);
  ivec2 high = (ivec2(corner) + 1) & (side - 1);
  int row = 2 * EMIT_CLOUD_SIDE - (2 * EMIT_CLOUD_SIDE >> level);
  vec2 near = vec2(texelFetch(cloud_field, ivec2(low.x, row + low.y), 0).r,
                   texelFetch(cloud_field, ivec2(low.x, row + high.y), 0).r);
  vec2 far = vec2(texelFetch(cloud_field, ivec2(high.x, row + low.y), 0).r,
                  texelFetch(cloud_field, ivec2(high.x, row + high.y), 0).r);
  vec2 rows = mix(near, far, part.x);
  return mix(rows.x, rows.y, part.y);
}

// Opacity at a place in tiles, the mean over about `width_m`.
float cloud_opacity(vec2 tile, float width_m) {
  float fine = clamp(log2(max(width_m * clouds.texels_per_m, 1.0)), 0.0, float(EMIT_CLOUD_LEVELS - 1));
  int level = min(int(fine), EMIT_CLOUD_LEVELS - 2);
  return mix(cloud_texels(level, tile), cloud_texels(level + 1, tile), fine - float(level));
}

// Difference in tiles of a difference in metres.
vec2 cloud_tiles(vec2 east_north_m) {
  return east_north_m.x * clouds.tiles_per_m.xy + east_north_m.y * clouds.tiles_per_m.zw;
}

// Direct sun at a point of relworld, by the mean of the weather. `width_m` is that of the pixel there.
float cloud_sun(vec3 point_m, float width_m) {
  float height_m = point_m.z + clouds.camera_m;
  if (height_m >= clouds.camera_m + clouds.above_m) return clouds.gain;
  vec2 tile = clouds.sun_tile + cloud_tiles(point_m.xy) + height_m * clouds.sun_tiles_per_m_up;
  return clouds.gain * (1.0 - clouds.depth * cloud_opacity(tile, width_m));
}

// Distance along a ray to the layer, over a round Earth.
float cloud_range_m(float sin_elevation) {
  float along_m = kCloudEarthRadiusM * sin_elevation;
  float above_m = max(clouds.above_m, 1.0);
  float square_m2 = above_m * (2.0 * kCloudEarthRadiusM + above_m);
  float root_m = sqrt(along_m * along_m + square_m2);
  return along_m > 0.0 ? square_m2 / (along_m + root_m) : root_m - along_m;
}

// Opacity of the clouds in a pixel of the sky. `direction` is its unit vector, relworld; `px_rad` its width. A camera in
// the layer or above it sees no clouds. The footprint of the pixel on the layer is long near the horizon: up to
// EMIT_CLOUD_TAPS places along it are averaged, and where they do not suffice the field is taken coarser.
float cloud_in_sky(vec3 direction, float range_m, float px_rad) {
  if (clouds.above_m <= 0.0) return 0.0;
  float sin_layer = (kCloudEarthRadiusM * direction.z + range_m) / (kCloudEarthRadiusM + clouds.above_m);
  float across_m = range_m * px_rad;
  float along_m = across_m / max(sin_layer, 1e-3);
  float width_m = max(across_m, along_m / float(EMIT_CLOUD_TAPS));
  int taps = clamp(int(ceil(along_m / width_m)), 1, EMIT_CLOUD_TAPS);
  vec2 step_tiles = cloud_tiles(normalize(direction.xy + vec2(1e-9, 0.0)) * (along_m / float(taps)));
  vec2 tile = clouds.camera_tile + cloud_tiles(range_m * direction.xy) - 0.5 * float(taps - 1) * step_tiles;
  float sum = 0.0;
  for (int tap = 0; tap < taps; ++tap) {
    sum += cloud_opacity(tile, width_m);
    tile += step_tiles;
  }
  return sum / float(taps);
}
