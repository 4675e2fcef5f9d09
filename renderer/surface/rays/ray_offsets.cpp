// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/ray_offsets.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace emit::renderer {
namespace {

/// Of the scene's radius: some roundings of float32.
constexpr float kRoundingFrac = 1e-6F;

}  // namespace

RayOffsets ray_offsets(const scene::SceneGeometry& geometry) noexcept {
  RayOffsets offsets;
  const scene::Aabb& bounds = geometry.bounds;
  if (bounds.empty()) return offsets;
  const double radius_m = 0.5 * glm::length(bounds.max_m - bounds.min_m);
  const float rounding_m = kRoundingFrac * static_cast<float>(radius_m);
  offsets.around_m = std::max(offsets.around_m, rounding_m);
  offsets.sun_m = std::max(offsets.sun_m, rounding_m);
  return offsets;
}

}  // namespace emit::renderer
