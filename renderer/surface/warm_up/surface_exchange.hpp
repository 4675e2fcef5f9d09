// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Integrates the history again with the samples' own radiation and conduction between them, until
/// the exchange has settled (Jacobi sweeps over whole histories, so the result does not depend on
/// the order of samples). What the patches' own evaluation gave is the first sweep. Fills states and
/// outputs of the model and frees the patches' histories. False when `report` stopped it.
/// @pre number_samples() has laid out the model
[[nodiscard]] bool exchange(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
                            std::vector<SurfacePatch>& patches, SurfaceModel& model,
                            const SurfaceProgress& report);

}  // namespace emit::renderer
