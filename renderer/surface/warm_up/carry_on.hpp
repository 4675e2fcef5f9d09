// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Advances the samples of a model from the begin of `inputs.record`, where their states and
/// outputs are, to its end. Samples stay where they are: the refinement is kept. Setup only; uses
/// all cores; deterministic. Errors: `internal` when stopped by `progress`.
[[nodiscard]] physics::Result<void> carry_on(const SurfaceInputs& inputs,
                                             const SurfaceModelOptions& options,
                                             SurfaceModel& model, const SurfaceProgress& progress);

}  // namespace emit::renderer
