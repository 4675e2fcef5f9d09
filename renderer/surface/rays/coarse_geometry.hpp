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

/// A scene with fewer triangles, and what it was; `detail` is empty where it has lost none.
struct CoarseGeometry {
  scene::SceneGeometry geometry;
  std::optional<SurfaceDetail> detail;
  bool visibly = false;  ///< for want of samples more went than no pixel shows
};

/// What no pixel shows goes, but for facets that would have to be cut again (kept_facets()), which
/// stay as long as the meshes' vertices leave half of `max_samples`: what lies between many small
/// things needs samples as well. Where the vertices would take more without those facets, too,
/// outlines of small bodies go (simplify_errors() by pixels alone), and then errors double up to
/// three times, to two pixels, if that is of use. Only vertices of meshes that may change count.
/// `to_suns`: unit directions in world axes. Setup only: seconds per million triangles. Errors:
/// those of CasterRays.
[[nodiscard]] physics::Result<CoarseGeometry> coarse_geometry(scene::SceneGeometry geometry,
                                                              const scene::DetailView& view,
                                                              std::span<const glm::vec3> to_suns,
                                                              std::size_t max_samples);

}  // namespace emit::renderer
