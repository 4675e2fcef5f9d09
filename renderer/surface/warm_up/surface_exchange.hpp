// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Lays the patches' samples out in one array, adds partners across convex edges and turns what
/// samples see from places into samples. Setup only.
void number_samples(const SurfaceInputs& inputs, const PatchSampler& sampler,
                    const SurfaceModelOptions& options, std::vector<SurfacePatch>& patches,
                    SurfaceModel& model);

/// Integrates the history again with the samples' own radiation and conduction between them, until
/// the exchange has settled (Jacobi sweeps over whole histories, so the result does not depend on
/// the order of samples). Fills states and outputs of the model. False when `report` stopped it.
[[nodiscard]] bool exchange(const SurfaceInputs& inputs, const PatchSampler& sampler,
                            const SurfaceModelOptions& options, std::vector<SurfacePatch>& patches,
                            SurfaceModel& model, const SurfaceProgress& report);

}  // namespace emit::renderer
