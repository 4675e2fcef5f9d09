// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include <glm/ext/vector_float3.hpp>

#include "surface/rays/caster_rays.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {

/// Shares of the full sphere of directions, with every solid angle alike. The sky share is f_i of
/// the model `emit2014`, 0.5 on open level ground (physics.md eq. 1). The shares add up to at most
/// 1.
struct SphereShares {
  float sky_frac = 0.0F;  ///< rays that left the scene at or above the horizon (+z is up)
  float far_frac = 0.0F;  ///< rays that left the scene below the horizon
};

/// View of a point in a fixed set of directions. On each hemisphere they form a spiral of equal
/// steps in height above the tangent plane, which are equal solid angles. Immutable; any thread; no
/// allocation after construction.
class SphereSampler {
 public:
  /// Makes the directions. `rays` is their number per hemisphere, rounded up to a multiple of 16,
  /// at least 16.
  explicit SphereSampler(std::uint32_t rays);

  /// Returns the view of a point of a face. Below its tangent plane it sees its own body.
  [[nodiscard]] SphereShares of_face(const CasterRays& casters, const ViewPoint& point,
                                     const CasterSelection& selection) const noexcept;
  /// Returns the view of a point of an edge or a corner, which has no tangent plane, in all
  /// directions. Here `point.normal` is any unit vector that points away from the solid.
  [[nodiscard]] SphereShares all_around(const CasterRays& casters, const ViewPoint& point,
                                        const CasterSelection& selection) const noexcept;

 private:
  /// Adds the shares of one hemisphere: that of the normal for `side` = 1, the opposite one for -1.
  void add_hemisphere(const CasterRays& casters, const ViewPoint& point, float side,
                      const CasterSelection& selection, SphereShares& shares) const noexcept;

  std::vector<glm::vec3> directions_;  ///< in the axes (tangent, bitangent, normal)
};

}  // namespace emit::renderer
