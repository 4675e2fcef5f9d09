// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_float3.hpp>

#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// Distances from the surface at which rays start, along its normal, in metres. They grow with the
/// distance from the origin, as float32 resolves less there.
struct RayOffsets {
  /// Offset of rays to the sky and to other faces.
  float around_m = 5e-4F;
  /// Offset of rays to the sun. It is smaller: half a millimetre would move the edge of a shadow by
  /// a tenth of a near pixel, always to the same side.
  float sun_m = 3e-5F;

  /// Returns the offsets at a place, which may be a stray far off. `rel_m` is in the axes of
  /// CasterRay.
  [[nodiscard]] RayOffsets at(const glm::vec3& rel_m) const noexcept;
};

/// Returns the offsets for the bulk of a scene (bulk_bounds()). Setup only.
[[nodiscard]] RayOffsets ray_offsets(const scene::SceneGeometry& geometry);

}  // namespace emit::renderer
