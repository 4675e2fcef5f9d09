// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Gives the samples near the creases of every body a column of cells that exchange heat along its
/// surface and across the crease (physics.md eq. 22): fills SurfaceSamples::columns and links, and
/// the column of each sample. A sample has one if it lies within two thicknesses of its stack of a
/// crease whose faces have vertices of their own. All conductances between two cells are the same
/// in both directions and positive. Faces at a convex edge that stand on ground become covered.
/// With emit2014 there are no columns. Setup only; uses all cores; deterministic.
/// @pre number_samples() has laid out the model, and name_bodies() has named its bodies
void link_columns(const SurfaceInputs& inputs, SurfaceModel& model);

}  // namespace emit::renderer
