// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <vector>

#include "emit/reference/visibility.hpp"
#include "emit/scene/mesh.hpp"
#include "points/point_histories.hpp"

namespace emit::reference {

/// Returns the share of the cosine-weighted hemisphere above a point that a triangle covers if
/// nothing hides it, by Lambert's sum over its edges. What lies below the tangent plane is cut off.
[[nodiscard]] double triangle_share(const glm::dvec3& point_m, const glm::dvec3& normal,
                                    const std::array<glm::dvec3, 3>& corners_m);

/// Parts of entities that have prescribed temperatures. They may be small and hot, so that the rays
/// of a hemisphere miss them or count them for far more than they are: their own triangles are
/// summed instead, each in pieces that are small for their distance, with a ray to the middle of
/// every piece. Made once, read by any thread. `geometry` outlives it.
class PrescribedParts {
 public:
  PrescribedParts(const scene::SceneGeometry& geometry, const RayScene& scene);

  [[nodiscard]] bool empty() const noexcept { return triangles_.empty(); }
  /// Returns what a point sees of them at an instant, one link per material. `own`: the point's own
  /// entity. `others`: other entities count too.
  [[nodiscard]] std::vector<PartLink> seen_from(const SurfacePoint& point, std::uint32_t own,
                                                bool others, const SceneInstant& instant) const;

 private:
  struct Triangle {
    std::array<glm::dvec3, 3> corners_m;  ///< in the frame of the entity
    std::uint32_t entity = 0;
    std::uint32_t material = 0;
    double area_m2 = 0.0;
  };
  const scene::SceneGeometry& geometry_;
  std::vector<Triangle> triangles_;
};

}  // namespace emit::reference
