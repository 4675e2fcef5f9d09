// SPDX-License-Identifier: Apache-2.0
// Discs of sun and moon in the sky, in pixels of the image (physics.md section 15). The twin is draw/sky_bodies.cpp.
#ifndef EMIT_SKY_DISC_GLSL
#define EMIT_SKY_DISC_GLSL

const float kEvenDiscPx = 2.0;       // smaller discs are evenly bright: the mean of their face
const float kDiscPoints = 32.0;      // points of a grid along the radius of larger ones
const float kStraightDiscPx = 16.0;  // edges of larger discs are straight within a pixel

// Share of the unit square around the origin that lies on the near side of a straight edge, 0..1. `distance` goes from
// the origin to the edge; `normal` is the unit vector to it.
float half_plane_frac(float distance, vec2 normal) {
  float larger = max(abs(normal.x), abs(normal.y));
  float smaller = min(abs(normal.x), abs(normal.y));
  float beyond = max(0.5 * (larger + smaller) - abs(distance), 0.0);
  float tip = 0.5 * beyond * beyond / max(larger * smaller, 1e-12);
  float covered = abs(distance) <= 0.5 * (larger - smaller) ? 0.5 + abs(distance) / larger : 1.0 - tip;
  return distance < 0.0 ? 1.0 - covered : covered;
}

// Share of a pixel that a disc covers, 0..1. `centre` is the disc's centre from the pixel's middle.
float disc_cover_frac(vec2 centre, float radius) {
  float away = length(centre);
  if (away > radius + 0.7072) return 0.0;
  if (away < radius - 0.7072) return 1.0;
  if (radius > kStraightDiscPx) return half_plane_frac(radius - away, -centre / away);
  // Integrate chords along the direction of the columns, by the midpoint rule in the angle on the disc.
  float first = asin(clamp((-0.5 - centre.x) / radius, -1.0, 1.0));
  float last = asin(clamp((0.5 - centre.x) / radius, -1.0, 1.0));
  float sum = 0.0;
  for (int i = 0; i < 16; ++i) {
    float half_chord = radius * cos(mix(first, last, (float(i) + 0.5) / 16.0));
    sum += max(min(0.5, centre.y + half_chord) - max(-0.5, centre.y - half_chord), 0.0) * half_chord;
  }
  return clamp(sum * (last - first) / 16.0, 0.0, 1.0);
}

// Points along a side of the square in which a pixel shows the face of a disc; their number is the square of it.
int disc_side(float radius) { return radius < kEvenDiscPx ? 16 : clamp(int(kDiscPoints / radius), 2, 16); }

// Point `i` of these: place in radii from the disc's centre, and weight.
vec3 disc_point(int i, int side, vec2 centre, float radius) {
  if (radius < kEvenDiscPx) {
    // Equal areas, golden-section angles.
    float share = (float(i) + 0.5) / float(side * side);
    float angle = 2.39996323 * float(i);
    return vec3(sqrt(share) * vec2(cos(angle), sin(angle)), 1.0);
  }
  // A grid in the pixel. Points beside the disc count only where there are no others.
  vec2 point = ((vec2(i % side, i / side) + 0.5) / float(side) - 0.5 - centre) / radius;
  float away = length(point);
  return away < 1.0 ? vec3(point, 1.0) : vec3(point * (0.99 / away), 1e-6);
}

#endif
