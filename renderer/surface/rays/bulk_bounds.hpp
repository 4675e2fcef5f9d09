// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_set.hpp"

namespace emit::renderer {

/// Box of the parts' triangles without strays: float32 coordinates relative to its centre resolve
/// what matters. That is the box of all vertices, unless it is wider than float32 resolves and much
/// wider than the box that holds all but a fiftieth of the triangles' centres along each axis; then
/// it is the latter, doubled. Empty without any finite vertex. Setup only.
[[nodiscard]] scene::Aabb bulk_bounds(std::span<const CasterPart> parts);

/// The same for the static geometry of a scene, or for all of it where nothing is static.
[[nodiscard]] scene::Aabb bulk_bounds(const scene::SceneGeometry& geometry);

}  // namespace emit::renderer
