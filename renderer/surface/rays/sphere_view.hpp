// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include <glm/ext/vector_float3.hpp>

#include "surface/rays/caster_rays.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {

/// Shares of the full sphere of directions, every solid angle alike: the sky measure of the model
/// `emit2014`, 0.5 on open level ground (physics.md, eq. 1). They add up to at most 1.
struct SphereShares {
  float sky_frac = 0.0F;  ///< left the scene at or above the horizon (+z is up)
  float far_frac = 0.0F;  ///< left the scene below the horizon
};

/// Looks into a fixed set of directions: on each hemisphere a spiral of equal steps in height above
/// the tangent plane, which are equal solid angles. Immutable, any thread, no allocation after
/// construction.
class SphereSampler {
 public:
  /// `rays` of a hemisphere; brought up to a multiple of 16, at least 16.
  explicit SphereSampler(std::uint32_t rays);

  /// A point of a face: below its tangent plane it sees its own body.
  [[nodiscard]] SphereShares of_face(const CasterRays& casters, const ViewPoint& point,
                                     const CasterSelection& selection) const noexcept;
  /// A point of an edge or a corner, which has no tangent plane: looks all around. Here
  /// `point.normal` is any unit vector that points away from the solid.
  [[nodiscard]] SphereShares all_around(const CasterRays& casters, const ViewPoint& point,
                                        const CasterSelection& selection) const noexcept;

 private:
  /// Adds what the hemisphere on the side of `side` times the normal shows.
  void add_hemisphere(const CasterRays& casters, const ViewPoint& point, float side,
                      const CasterSelection& selection, SphereShares& shares) const noexcept;

  std::vector<glm::vec3> directions_;  ///< (tangent, bitangent, normal)
};

}  // namespace emit::renderer
