// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/sampling.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

constexpr std::uint32_t reverse_bits(std::uint32_t x) noexcept {
  x = (x << 16U) | (x >> 16U);
  x = ((x & 0x00ff00ffU) << 8U) | ((x & 0xff00ff00U) >> 8U);
  x = ((x & 0x0f0f0f0fU) << 4U) | ((x & 0xf0f0f0f0U) >> 4U);
  x = ((x & 0x33333333U) << 2U) | ((x & 0xccccccccU) >> 2U);
  return ((x & 0x55555555U) << 1U) | ((x & 0xaaaaaaaaU) >> 1U);
}

/// Integer hash with full avalanche.
constexpr std::uint32_t mix(std::uint32_t x) noexcept {
  x ^= x >> 16U;
  x *= 0x7feb352dU;
  x ^= x >> 15U;
  x *= 0x846ca68bU;
  return x ^ (x >> 16U);
}

/// Flips every bit by a random function of all bits above it. `x` holds the digits reversed, so
/// that "above" is "below" and plain arithmetic carries the right way (Laine and Karras 2011). With
/// the constants of Burley 2020 each step stays a nested permutation: additions, odd
/// multiplications and xor with even multiples let no bit act on a lower one.
constexpr std::uint32_t nested_scramble_reversed(std::uint32_t x, std::uint32_t seed) noexcept {
  x ^= x * 0x3d20adeaU;
  x += seed;
  x *= (seed >> 16U) | 1U;
  x ^= x * 0x05526c56U;
  x ^= x * 0x53a22864U;
  return x;
}

/// Returns the second dimension of Sobol's sequence (primitive polynomial x + 1), digits reversed.
constexpr std::uint32_t sobol_second_reversed(std::uint32_t index) noexcept {
  std::uint32_t result = 0;
  std::uint32_t column = 1U << 31U;
  for (; index != 0; index >>= 1U, column ^= column >> 1U) {
    if ((index & 1U) != 0) result ^= column;
  }
  return reverse_bits(result);
}

}  // namespace

glm::dvec2 sobol_owen_2d(std::uint32_t index, std::uint32_t seed) noexcept {
  // Scramble the index itself: with its bits reversed it is the first dimension.
  const std::uint32_t x = reverse_bits(nested_scramble_reversed(index, mix(seed ^ 0x9e3779b9U)));
  // Scramble the second dimension with another seed.
  const std::uint32_t y =
      reverse_bits(nested_scramble_reversed(sobol_second_reversed(index), mix(seed ^ 0x85ebca77U)));
  return {(x + 0.5) * 0x1p-32, (y + 0.5) * 0x1p-32};
}

glm::dvec2 disc_from_square(const glm::dvec2& square) noexcept {
  const double a = 2.0 * square.x - 1.0;
  const double b = 2.0 * square.y - 1.0;
  if (a == 0.0 && b == 0.0) return {0.0, 0.0};
  // Map the square's rings to circles, quarter by quarter.
  const bool wide = std::abs(a) > std::abs(b);
  const double radius = wide ? a : b;
  const double angle_rad =
      wide ? physics::kPi / 4.0 * (b / a) : physics::kPi / 2.0 - physics::kPi / 4.0 * (a / b);
  return {radius * std::cos(angle_rad), radius * std::sin(angle_rad)};
}

Tangents tangents_of(const glm::dvec3& axis) noexcept {
  const double sign = std::copysign(1.0, axis.z);
  const double a = -1.0 / (sign + axis.z);
  const double b = axis.x * axis.y * a;
  return {{1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x},
          {b, sign + axis.y * axis.y * a, -axis.y}};
}

glm::dvec3 cap_direction(const glm::dvec2& disc, const glm::dvec3& axis, const Tangents& tangents,
                         double semi_angle_rad) noexcept {
  // Apply 1 - cos(theta) = r^2 (1 - cos(semi)) by half angles, so that small caps keep their
  // digits.
  const double half = std::sin(0.5 * semi_angle_rad);
  const double r2 = disc.x * disc.x + disc.y * disc.y;
  const double versine = 2.0 * half * half * r2;
  const double scale = half * std::sqrt(std::max(2.0 * (2.0 - versine), 0.0));
  return tangents.u * (disc.x * scale) + tangents.v * (disc.y * scale) + axis * (1.0 - versine);
}

glm::dvec3 cosine_direction(const glm::dvec2& disc, const glm::dvec3& axis,
                            const Tangents& tangents) noexcept {
  const double height = std::sqrt(std::max(1.0 - disc.x * disc.x - disc.y * disc.y, 0.0));
  return tangents.u * disc.x + tangents.v * disc.y + axis * height;
}

}  // namespace emit::reference
