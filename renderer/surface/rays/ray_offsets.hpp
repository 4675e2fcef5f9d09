// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <glm/ext/vector_float3.hpp>
#include <glm/geometric.hpp>

namespace emit::renderer {

/// Distances from the surface at which rays start, along its normal, in metres.
struct RayOffsets {
  /// Offset of rays to the sky and to other faces.
  float around_m = 5e-4F;
  /// Offset of rays to the sun. It is smaller: half a millimetre would move the edge of a shadow by
  /// a tenth of a near pixel, always to the same side.
  float sun_m = 3e-5F;
};

/// Returns what float32 may lose around a place: eight units in the last place of its distance from
/// the origin, and of the longest edge of the triangles on which it lies. RT-safe.
[[nodiscard]] inline float ray_rounding_m(const glm::vec3& at_m, float facet_m = 0.0F) noexcept {
  constexpr float kRoundingFrac = 1e-6F;
  return kRoundingFrac * std::max(glm::length(at_m), facet_m);
}

/// Returns the offsets at a place of the surface. They depend on nothing else in the scene.
/// `facet_m` is the longest edge of the triangles on which it lies. Everything is in the axes in
/// which the rays are traced. RT-safe.
[[nodiscard]] inline RayOffsets ray_offsets(const glm::vec3& at_m, float facet_m) noexcept {
  const float rounding_m = ray_rounding_m(at_m, facet_m);
  constexpr RayOffsets kLeast;
  return {std::max(kLeast.around_m, rounding_m), std::max(kLeast.sun_m, rounding_m)};
}

}  // namespace emit::renderer
