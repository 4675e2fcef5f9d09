// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Links the samples near the creases of every body to their neighbours along its surface
/// (physics.md eq. 22): fills SurfaceSamples::links, and the links and the cut of each sample. A
/// sample is linked if it lies within two thicknesses of its stack of a crease whose faces are
/// both there. All conductances between two samples are the same in both directions. Faces at a
/// convex edge that stand on ground become covered. With emit2014 nothing is linked. Setup only;
/// uses all cores; deterministic.
/// @pre number_samples() has laid out the model, and name_bodies() has named its bodies
void link_columns(const SurfaceInputs& inputs, SurfaceModel& model);

}  // namespace emit::renderer
