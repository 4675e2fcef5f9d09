// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Lays the samples of all patches out in one array, and turns the places that they see into
/// samples. Samples that share a view share its list of seen samples. Frees the views of the
/// patches. Setup only; uses all cores; deterministic.
void number_samples(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
                    std::vector<SurfacePatch>& patches, SurfaceModel& model);

}  // namespace emit::renderer
