// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/scene/simplify.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Returns the triangles of each mesh that should survive simplification, because the warm-up would
/// have to halve their replacement again. They look wider than a pixel, some eye sees them, the sun
/// reaches them, and the surface bends in them, so that the sun warms their corners unequally.
/// Small gaps between them are closed.
/// The result has one entry per triangle for each mesh. The list is empty for a mesh whose entry of
/// `errors` (scene::simplify_errors()) is 0, and for one of which nothing is kept: simplification
/// may then move its outer borders too.
/// `rays` must be against `geometry`. `to_suns` are unit directions in world axes. Setup only:
/// seconds per million triangles.
[[nodiscard]] std::vector<std::vector<bool>> kept_facets(const scene::SceneGeometry& geometry,
                                                         std::span<const double> errors,
                                                         const CasterRays& rays,
                                                         const scene::DetailView& view,
                                                         std::span<const glm::vec3> to_suns);

}  // namespace emit::renderer
