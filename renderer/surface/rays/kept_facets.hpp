// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/scene/simplify.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Triangles that would only have to be halved again if a mesh lost them in simplification: they
/// look wider than a pixel, some eye sees them, the sun has come to them, and the surface bends in
/// them, so that it warmed their corners unequally. Small gaps between them are closed. By mesh,
/// one entry per triangle; empty where none is kept, as where `errors`, of
/// scene::simplify_errors(), is 0: such a mesh may lose its borders, too. `rays`: against
/// `geometry`. `to_suns`: unit directions in world axes. Setup only: seconds per million triangles.
[[nodiscard]] std::vector<std::vector<bool>> kept_facets(const scene::SceneGeometry& geometry,
                                                         std::span<const double> errors,
                                                         const CasterRays& rays,
                                                         const scene::DetailView& view,
                                                         std::span<const glm::vec3> to_suns);

}  // namespace emit::renderer
