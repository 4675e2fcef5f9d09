// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/geometric.hpp>

/// Column of a Gaussian puff of gas along a line of sight (physics.md eq. 54), in float32 as
/// shaders/lib/gas_puff.glsl computes it. Any thread. RT-safe.
namespace emit::physics {

/// Error function by formula 7.1.26 of Abramowitz and Stegun, within 1.5e-7.
[[nodiscard]] inline float gas_erf(float x) noexcept {
  const float size = std::abs(x);
  const float t = 1.0F / (1.0F + 0.3275911F * size);
  const float sum =
      t * (0.254829592F +
           t * (-0.284496736F + t * (1.421413741F + t * (-1.453152027F + t * 1.061405429F))));
  const float value = 1.0F - sum * std::exp(-size * size);
  return x < 0.0F ? -value : value;
}

/// Share of a normal distribution between two places, in standard deviations.
[[nodiscard]] inline float gas_between(float from, float to) noexcept {
  return 0.5F * (gas_erf(0.70710678F * to) - gas_erf(0.70710678F * from));
}

/// Column at a place of the image, by that through the middle, averaged over a small rectangle of
/// sides `side`. `covariance` are the variances across and down and what mixes them, as x, z and y,
/// and their determinant is above 0. The rectangle counts as a Gaussian of its own variance.
[[nodiscard]] inline float gas_image_column(const glm::vec2& away, const glm::vec3& covariance,
                                            const glm::vec2& side) noexcept {
  const glm::vec3 wide = covariance + glm::vec3(side.x * side.x, 0.0F, side.y * side.y) / 12.0F;
  const float before = covariance.x * covariance.z - covariance.y * covariance.y;
  const float after = wide.x * wide.z - wide.y * wide.y;
  const float square =
      (away.x * away.x * wide.z - 2.0F * away.x * away.y * wide.y + away.y * away.y * wide.x) /
      after;
  return std::sqrt(before / after) * std::exp(-0.5F * square);
}

/// Density of a puff along a line of sight.
struct GasLine {
  float square = 0.0F;   ///< of the distance of the line from the middle, in standard deviations
  float place_m = 0.0F;  ///< distance from the sensor to the densest place
  float sigma_m = 0.0F;  ///< standard deviation along the line
};
/// Follows the unit vector `ray` from the sensor past a puff with its middle at `middle_m`. Both
/// 1 / variances, across and along the axis, are above 0. Parts along and across are added up and
/// never subtracted, because long and thin puffs would lose their digits.
[[nodiscard]] inline GasLine gas_line(const glm::vec3& ray, const glm::vec3& middle_m,
                                      float per_across_m2, const glm::vec3& axis,
                                      float per_along_m2) noexcept {
  const float ray_along = glm::dot(ray, axis);
  const float middle_along_m = glm::dot(middle_m, axis);
  const glm::vec3 ray_across = ray - ray_along * axis;
  const glm::vec3 middle_across_m = middle_m - middle_along_m * axis;
  const float a =
      per_across_m2 * glm::dot(ray_across, ray_across) + per_along_m2 * ray_along * ray_along;
  const float b = per_across_m2 * glm::dot(ray_across, middle_across_m) +
                  per_along_m2 * ray_along * middle_along_m;
  const float place_m = b / a;
  const glm::vec3 off_across_m = place_m * ray_across - middle_across_m;
  const float off_along_m = place_m * ray_along - middle_along_m;
  return {.square = per_across_m2 * glm::dot(off_across_m, off_across_m) +
                    per_along_m2 * off_along_m * off_along_m,
          .place_m = place_m,
          .sigma_m = 1.0F / std::sqrt(a)};
}

/// Share of the column that lies between the sensor and a surface, by the distances along the line
/// of sight in standard deviations: of the puff's middle and of the surface.
[[nodiscard]] inline float gas_before(float middle, float surface) noexcept {
  return gas_between(-middle, surface - middle);
}

}  // namespace emit::physics
