// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_GAS_PUFF
#define EMIT_LIB_GAS_PUFF

// Column of a Gaussian puff of gas along a line of sight (physics.md eq. 54). Twin of physics/gas/puff.hpp.

// Error function by formula 7.1.26 of Abramowitz and Stegun, within 1.5e-7.
float gas_erf(float x) {
  float size = abs(x);
  float t = 1.0 / (1.0 + 0.3275911 * size);
  float sum = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
  float value = 1.0 - sum * exp(-size * size);
  return x < 0.0 ? -value : value;
}

// Share of a normal distribution between two places, in standard deviations.
float gas_between(float from, float to) {
  return 0.5 * (gas_erf(0.70710678 * to) - gas_erf(0.70710678 * from));
}

// Column at a place of the image, by that through the middle, averaged over a small rectangle. `covariance` are the
// variances across and down and what mixes them, as x, z and y. The rectangle counts as a Gaussian of its own variance.
float gas_image_column(vec2 away, vec3 covariance, vec2 side) {
  vec3 wide = covariance + vec3(side.x * side.x, 0.0, side.y * side.y) / 12.0;
  float before = covariance.x * covariance.z - covariance.y * covariance.y;
  float after = wide.x * wide.z - wide.y * wide.y;
  float square = (away.x * away.x * wide.z - 2.0 * away.x * away.y * wide.y + away.y * away.y * wide.x) / after;
  return sqrt(before / after) * exp(-0.5 * square);
}

// Density along a line of sight: x = square of the distance of the line from the middle, in standard deviations, y =
// distance from the sensor to the densest place, z = standard deviation along the line. `axis` holds the axis and 1 /
// variance along it, `across` is 1 / variance across it. Parts along and across are added up and never subtracted,
// because long and thin puffs would lose their digits.
vec3 gas_line(vec3 ray, vec3 middle, float across, vec4 axis) {
  float ray_along = dot(ray, axis.xyz);
  float middle_along = dot(middle, axis.xyz);
  vec3 ray_across = ray - ray_along * axis.xyz;
  vec3 middle_across = middle - middle_along * axis.xyz;
  float a = across * dot(ray_across, ray_across) + axis.w * ray_along * ray_along;
  float b = across * dot(ray_across, middle_across) + axis.w * ray_along * middle_along;
  float place = b / a;
  vec3 off_across = place * ray_across - middle_across;
  float off_along = place * ray_along - middle_along;
  return vec3(across * dot(off_across, off_across) + axis.w * off_along * off_along, place, inversesqrt(a));
}

// Share of the column that lies between the sensor and a surface, by the distances along the line of sight in standard
// deviations: of the puff's middle and of the surface.
float gas_before(float middle, float surface) { return gas_between(-middle, surface - middle); }
#endif
