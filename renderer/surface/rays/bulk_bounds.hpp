// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_set.hpp"

namespace emit::renderer {

/// Returns the box of the parts' triangles without strays, in their common frame: float32
/// coordinates relative to its centre resolve what matters. It is the box of all finite vertices,
/// with one exception: if that box is wider than float32 resolves and 16 times as wide as the
/// doubled box of all but a fiftieth of the triangles' centres along each axis, it is the box of
/// the triangles within four widths of that doubled box. Strays therefore do not move its centre.
/// The box is empty if no vertex is finite. Setup only.
[[nodiscard]] scene::Aabb bulk_bounds(std::span<const CasterPart> parts);

/// Returns the same box for the static geometry of a scene, or for all geometry if nothing is
/// static.
[[nodiscard]] scene::Aabb bulk_bounds(const scene::SceneGeometry& geometry);

}  // namespace emit::renderer
