// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// How far off the surface rays start, along its normal, m: more where float32 resolves less.
struct RayOffsets {
  float around_m = 5e-4F;
  /// Towards the sun less: half a millimetre moves the edge of a shadow by a tenth of a near pixel,
  /// always to the same side.
  float sun_m = 3e-5F;
};
[[nodiscard]] RayOffsets ray_offsets(const scene::SceneGeometry& geometry) noexcept;

}  // namespace emit::renderer
