// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_float3.hpp>

#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// How far off the surface rays start, along its normal, in metres: more where float32 resolves
/// less.
struct RayOffsets {
  float around_m = 5e-4F;
  /// Towards the sun less: half a millimetre moves the edge of a shadow by a tenth of a near pixel,
  /// always to the same side.
  float sun_m = 3e-5F;

  /// Those of a place, which may be a stray far off. `rel_m`: in the axes of CasterRay.
  [[nodiscard]] RayOffsets at(const glm::vec3& rel_m) const noexcept;
};

/// Offsets of the bulk of a scene (bulk_bounds()). Setup only.
[[nodiscard]] RayOffsets ray_offsets(const scene::SceneGeometry& geometry);

}  // namespace emit::renderer
