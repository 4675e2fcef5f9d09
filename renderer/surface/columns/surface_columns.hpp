// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Returns the distance from the foot of a solid (SurfaceSample::foot_m) up to which samples of a
/// material have columns, on both sides of its wall; 0 where no heat moves along the surface.
[[nodiscard]] float foot_reach_m(const scene::Material& material) noexcept;

/// Gives the samples near the creases of every body, and beside and under the feet of solids, a
/// column of cells that exchange heat along the surface and across the crease, and with the wall
/// that stands there (physics.md eq. 22): fills SurfaceSamples::columns and links, and the column
/// of each sample. A sample has one if it lies within two thicknesses of its stack of a crease
/// whose faces have vertices of their own, within foot_reach_m(), or on a solid so thin that the
/// stacks of opposite faces reach each other. All conductances between two cells are the same in
/// both directions and positive. Faces at a convex edge that stand on ground become covered. With
/// emit2014 there are no columns. Setup only; uses all cores; deterministic.
/// @pre number_samples() has laid out the model, and name_bodies() has named its bodies
void link_columns(const SurfaceInputs& inputs, SurfaceModel& model);

}  // namespace emit::renderer
