// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>

/// Deterministic sampling of discs, caps and hemispheres. Any thread; RT-safe.
namespace emit::reference {

/// Point `index` of the two-dimensional Sobol sequence in [0, 1)^2, with Owen's nested uniform
/// scrambling by a hash of `seed`: every 2^k points from a multiple of 2^k on hold one point in
/// each elementary rectangle of area 2^-k.
[[nodiscard]] glm::dvec2 sobol_owen_2d(std::uint32_t index, std::uint32_t seed) noexcept;

/// Area-preserving map of the unit square to the unit disc (Shirley and Chiu 1997).
[[nodiscard]] glm::dvec2 disc_from_square(const glm::dvec2& square) noexcept;

/// Two unit vectors that make a right-handed frame with the unit vector `axis` (Duff et al. 2017).
struct Tangents {
  glm::dvec3 u;
  glm::dvec3 v;
};
[[nodiscard]] Tangents tangents_of(const glm::dvec3& axis) noexcept;

/// Direction within `semi_angle_rad` of `axis` for a point of the unit disc, by equal solid angle
/// (Lambert's azimuthal projection); pi gives the full sphere, pi/2 the hemisphere.
[[nodiscard]] glm::dvec3 cap_direction(const glm::dvec2& disc, const glm::dvec3& axis,
                                       const Tangents& tangents, double semi_angle_rad) noexcept;

/// Cosine-distributed direction about `axis` for a point of the unit disc.
[[nodiscard]] glm::dvec3 cosine_direction(const glm::dvec2& disc, const glm::dvec3& axis,
                                          const Tangents& tangents) noexcept;

}  // namespace emit::reference
