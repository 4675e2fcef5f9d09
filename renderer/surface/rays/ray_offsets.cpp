// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/ray_offsets.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "surface/rays/bulk_bounds.hpp"

namespace emit::renderer {
namespace {

/// Room for several roundings of float32, as a share of the distance from the origin.
constexpr float kRoundingFrac = 1e-6F;

/// Returns offsets that are at least `rounding_m`.
RayOffsets at_least(const RayOffsets& offsets, float rounding_m) noexcept {
  return {std::max(offsets.around_m, rounding_m), std::max(offsets.sun_m, rounding_m)};
}

}  // namespace

RayOffsets RayOffsets::at(const glm::vec3& rel_m) const noexcept {
  return at_least(*this, kRoundingFrac * glm::length(rel_m));
}

RayOffsets ray_offsets(const scene::SceneGeometry& geometry) {
  const scene::Aabb bounds = bulk_bounds(geometry);
  if (bounds.empty()) return {};
  const double radius_m = 0.5 * glm::length(bounds.max_m - bounds.min_m);
  return at_least({}, kRoundingFrac * static_cast<float>(radius_m));
}

}  // namespace emit::renderer
