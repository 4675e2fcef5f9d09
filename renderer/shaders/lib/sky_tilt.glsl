// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_SKY_TILT
#define EMIT_LIB_SKY_TILT

// Mean radiance of the sky as a face sees it (physics.md eq. 44). Twin of physics::sky_at_tilt() in
// emit/physics/sky_state.hpp. The including shader defines EMIT_SKY_TILT(band, node), the radiance of a band at a node.

// Place of a face on the nodes: x = index of the node before it, y = position behind it, 0..1. `normal_up` is the
// vertical component of its unit normal.
vec2 sky_tilt_place(float normal_up) {
  float place = float(EMIT_SKY_TILTS - 1) / EMIT_PI * acos(clamp(normal_up, -1.0, 1.0));
  float node = min(floor(place), float(EMIT_SKY_TILTS - 2));
  return vec2(node, place - node);
}

// Radiance of a band at a place, W m-2 sr-1.
float sky_at_tilt_w_m2_sr(uint band, vec2 place) {
  int node = int(place.x);
  return mix(EMIT_SKY_TILT(band, node), EMIT_SKY_TILT(band, node + 1), place.y);
}

#endif
