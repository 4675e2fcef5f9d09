// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <glm/ext/vector_float3.hpp>
#include <optional>
#include <span>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/simplify.hpp"
#include "surface/rays/surface_detail.hpp"

namespace emit::renderer {

/// Scene with fewer triangles, and the scene as loaded. `detail` is empty if no mesh has lost
/// triangles.
struct CoarseGeometry {
  scene::SceneGeometry geometry;
  std::optional<SurfaceDetail> detail;
  bool visibly = false;  ///< more was removed than no pixel shows, because samples ran short
};

/// Removes detail that no pixel of the scenario can show, so that samples are not spent on it.
/// Facets that the warm-up would have to halve again (kept_facets()) stay as long as the vertices
/// of the meshes leave half of `max_samples` for what lies between many small things.
/// If the vertices exceed that even without those facets, outlines of small bodies become coarser
/// (simplify_errors() by pixels alone). After that the errors double up to three times, to two
/// pixels, if that removes enough. Only vertices of meshes that may change are counted.
/// `to_suns` are unit directions in world axes. Setup only: seconds per million triangles. Errors:
/// those of CasterRays.
[[nodiscard]] physics::Result<CoarseGeometry> coarse_geometry(scene::SceneGeometry geometry,
                                                              const scene::DetailView& view,
                                                              std::span<const glm::vec3> to_suns,
                                                              std::size_t max_samples);

}  // namespace emit::renderer
