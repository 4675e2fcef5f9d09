// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>

/// Deterministic sampling of discs, caps and hemispheres. Any thread; RT-safe.
namespace emit::reference {

/// Returns point `index` of the two-dimensional Sobol sequence in [0, 1)^2, with Owen's nested
/// uniform scrambling by a hash of `seed`. Every 2^k points that start at a multiple of 2^k put one
/// point into each elementary rectangle of area 2^-k.
[[nodiscard]] glm::dvec2 sobol_owen_2d(std::uint32_t index, std::uint32_t seed) noexcept;

/// Maps the unit square to the unit disc with equal areas (Shirley and Chiu 1997).
[[nodiscard]] glm::dvec2 disc_from_square(const glm::dvec2& square) noexcept;

/// Two unit vectors that make a right-handed frame with a unit vector (Duff et al. 2017).
struct Tangents {
  glm::dvec3 u;
  glm::dvec3 v;
};
/// Returns the tangents of a unit vector.
[[nodiscard]] Tangents tangents_of(const glm::dvec3& axis) noexcept;

/// Maps a point of the unit disc to a direction within `semi_angle_rad` of `axis`, with equal solid
/// angles (Lambert's azimuthal projection). An angle of pi gives the full sphere, pi/2 the
/// hemisphere.
[[nodiscard]] glm::dvec3 cap_direction(const glm::dvec2& disc, const glm::dvec3& axis,
                                       const Tangents& tangents, double semi_angle_rad) noexcept;

/// Maps a point of the unit disc to a cosine-distributed direction about `axis`.
[[nodiscard]] glm::dvec3 cosine_direction(const glm::dvec2& disc, const glm::dvec3& axis,
                                          const Tangents& tangents) noexcept;

}  // namespace emit::reference
