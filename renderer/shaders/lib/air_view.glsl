// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_AIR_VIEW
#define EMIT_LIB_AIR_VIEW

// Air of the built-in model around a sensor (physics.md eq. 39). Twin of emit/physics/air_view.hpp, which makes the
// tables and evaluates them on the CPU.
// The including shader defines EMIT_AIR_VIEW(index), the node at that place of its buffer, a vec4. `first` is the index
// of the first node of a table.
// The axes below are those of AirView; the tests compare the two.
const int kAirHeights = 22;
const int kAirRanges = 29;
const int kAirElevations = 48;
const int kAirPhases = 129;
const float kAirNearestM = 1.0;
const float kAirRangeNodesPerUnit = 28.0 / 11.5129254649702;    // by ln(100 km / 1 m)
const float kAirElevationScale = 0.03;
const float kAirFirstElevation = -2.43544432439976;             // asinh(-0.17 / 0.03)
const float kAirElevationNodesPerUnit = 47.0 / (4.19993000198038 + 2.43544432439976);

// Place on an axis of `nodes` nodes: x = index of the cell, y = position in it, 0..1. The ends are held.
vec2 air_view_cell(float place, int nodes) {
  float held = clamp(place, 0.0, float(nodes - 1));
  float index = min(floor(held), float(nodes - 2));
  return vec2(index, held - index);
}

// Place of a line of sight in a table: its cell and the position in it. The sky has one row.
struct AirPlace {
  int low;       // index of the cell's first node, from the start of the table
  int row;       // distance to the node of the next height; 0 in the sky
  float along;   // position between two ranges or elevations, 0..1
  float across;  // position between two heights
};

// Place of a line of sight of `range_m` to a target at a height above sea level.
AirPlace air_view_sight_place(float target_m, float range_m) {
  float km = target_m * 1e-3;
  float place = 4.0 * clamp(km, 0.0, 2.0) + 2.0 * clamp(km - 2.0, 0.0, 1.0) + clamp(km - 3.0, 0.0, 9.0) +
                0.2 * clamp(km - 12.0, 0.0, 10.0);
  vec2 target = air_view_cell(place, kAirHeights);
  vec2 range = air_view_cell(log(max(range_m, 1e-3) / kAirNearestM) * kAirRangeNodesPerUnit, kAirRanges);
  return AirPlace(kAirRanges * int(target.x) + int(range.x), kAirRanges, range.y, target.y);
}

// Place of a direction of the sky.
AirPlace air_view_sky_place(float sin_elevation) {
  float x = sin_elevation / kAirElevationScale;
  float root = log(abs(x) + sqrt(x * x + 1.0));
  vec2 place = air_view_cell(((x < 0.0 ? -root : root) - kAirFirstElevation) * kAirElevationNodesPerUnit,
                             kAirElevations);
  return AirPlace(kAirHeights * kAirRanges + int(place.x), 0, place.y, 0.0);
}

// Node at a place of the table that starts at `first`. Along a line of sight x, y, z are the logarithm of the mean
// extinction in m-1 for surfaces near 300 K, hot ones and reflected sunlight, and w is the path radiance by 1 - tau of
// the first. Towards the sky x, y, z are the optical depth to space for the three sources, and w is the sky's radiance.
vec4 air_view_node(int first, AirPlace place) {
  int low = first + place.low;
  int high = low + place.row;
  vec4 near = mix(EMIT_AIR_VIEW(low), EMIT_AIR_VIEW(low + 1), place.along);
  vec4 far = mix(EMIT_AIR_VIEW(high), EMIT_AIR_VIEW(high + 1), place.along);
  return mix(near, far, place.across);
}

// Phase functions at the cosine of the angle between a line of sight and the sun, sr-1, by kind of scatterer. `first` is
// the index of the first node of a table of scattered sunlight, at whose end they lie.
vec4 air_sun_phase(int first, float cosine) {
  vec2 place = air_view_cell(sqrt(max(0.5 - 0.5 * cosine, 0.0)) * float(kAirPhases - 1), kAirPhases);
  int low = first + kAirHeights * kAirRanges + kAirElevations + int(place.x);
  return mix(EMIT_AIR_VIEW(low), EMIT_AIR_VIEW(low + 1), place.y);
}

// Sunlight that the air scatters at a place of the view, W m-2 sr-1: for the sky its radiance, along a line of sight its
// radiance by 1 - tau of the first source. Its table has the nodes of the view, but their numbers are light by kind of
// scatterer.
float air_sun_w_m2_sr(int first, AirPlace place, float cosine) {
  return dot(air_view_node(first, place), air_sun_phase(first, cosine));
}

// Transmittance over a range for a logarithm of the mean extinction.
float air_view_transmittance(float log_extinction, float range_m) {
  return exp(-exp(log_extinction) * range_m);
}

// Path radiance of a line of sight, W m-2 sr-1.
float air_view_path_w_m2_sr(vec4 sight, float range_m) {
  float depth = exp(sight.x) * range_m;
  // Use the series where the difference would cancel.
  float opacity = depth < 0.01 ? depth * (1.0 - depth * (0.5 - depth / 6.0)) : 1.0 - exp(-depth);
  return opacity * sight.w;
}

#endif
