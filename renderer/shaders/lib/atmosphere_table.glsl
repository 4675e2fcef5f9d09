// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_ATMOSPHERE_TABLE
#define EMIT_LIB_ATMOSPHERE_TABLE

// Tabulated air between sensor and surface (physics.md eq. 14 and 15). Twin of emit/physics/atmosphere_table.hpp, which
// lays the table out and evaluates it in double.
// The including shader defines EMIT_ATMOSPHERE_TABLE(index), the float at that place of its buffer.
// `grid`: x = index of the table's first float, y = number of ranges (>= 2), z = number of elevations (>= 1).

// Cell of the ascending axis that starts at index `first`, for the value `x`. Result: x = index of the cell, y =
// position in it, 0..1. Sets `clamped` where `x` lies outside the axis.
vec2 atmosphere_table_cell(int first, int nodes, float x, inout bool clamped) {
  float lowest = EMIT_ATMOSPHERE_TABLE(first);
  float highest = EMIT_ATMOSPHERE_TABLE(first + nodes - 1);
  if (!(x >= lowest)) {
    clamped = true;
    return vec2(0.0);
  }
  if (x > highest) {
    clamped = true;
    return vec2(float(nodes - 2), 1.0);
  }
  int low = 0;
  int high = nodes - 1;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (x < EMIT_ATMOSPHERE_TABLE(first + middle)) high = middle; else low = middle;
  }
  float a = EMIT_ATMOSPHERE_TABLE(first + low);
  float b = EMIT_ATMOSPHERE_TABLE(first + low + 1);
  return vec2(float(low), clamp((x - a) / (b - a), 0.0, 1.0));
}

// Optical depth and path radiance (W m-2 sr-1) of one elevation. `place` is a result of atmosphere_table_cell.
vec2 atmosphere_table_at(int first, vec2 place) {
  int i = first + 2 * int(place.x);
  vec2 a = vec2(EMIT_ATMOSPHERE_TABLE(i), EMIT_ATMOSPHERE_TABLE(i + 1));
  vec2 b = vec2(EMIT_ATMOSPHERE_TABLE(i + 2), EMIT_ATMOSPHERE_TABLE(i + 3));
  float u = place.y;
  float depth = b.x - a.x;
  // Evaluate (1 - e^(-u d)) / (1 - e^(-d)). Use its series where the differences would cancel.
  float share = depth > 0.02 ? (1.0 - exp(-u * depth)) / (1.0 - exp(-depth))
                             : u * (1.0 + 0.5 * depth * (1.0 - u) * (1.0 + depth * (1.0 - 2.0 * u) / 6.0));
  return vec2(a.x + u * depth, a.y + share * (b.y - a.y));
}

// Air between sensor and surface: x = transmittance, y = path radiance in W m-2 sr-1. Outside the grid its edge is used
// and `clamped` is set (never cleared).
vec2 atmosphere_table_air(uvec4 grid, float range_m, float sin_elevation, inout bool clamped) {
  int ranges = int(grid.y);
  int elevations = int(grid.z);
  int axis = int(grid.x);
  int values = axis + ranges + elevations;
  vec2 range_place = atmosphere_table_cell(axis, ranges, range_m, clamped);
  vec2 air = vec2(0.0);
  if (elevations == 1) {
    air = atmosphere_table_at(values, range_place);
  } else {
    // Hold the sine in its range, because rounding must not take a line of sight past the zenith.
    float sine = clamp(sin_elevation, -1.0, 1.0);
    vec2 elevation_place = atmosphere_table_cell(axis + ranges, elevations, sine, clamped);
    int row = values + 2 * ranges * int(elevation_place.x);
    air = mix(atmosphere_table_at(row, range_place), atmosphere_table_at(row + 2 * ranges, range_place),
              elevation_place.y);
  }
  return vec2(exp(-air.x), air.y);
}

// Air between sensor and space: x = transmittance, y = path radiance in W m-2 sr-1. The last range of the table stands
// for it.
vec2 atmosphere_table_out(uvec4 grid, float sin_elevation, inout bool clamped) {
  return atmosphere_table_air(grid, EMIT_ATMOSPHERE_TABLE(int(grid.x + grid.y) - 1), sin_elevation, clamped);
}

#endif
