// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "surface/model/surface_model.hpp"
#include "surface/warm_up/surface_exchange.hpp"

namespace emit::renderer {

/// Appends the twins of all samples whose material has twins: samples at the same place, with the
/// same view and the same history of sun and sky, and with the properties that the clutter gives
/// the material where its field is -kTwinSd and +kTwinSd. Their states are those at the start of
/// the history. Setup only: it uses all cores.
/// @pre the samples have numbers, columns and histories
void add_twins(const SurfaceInputs& inputs, SampleHistories& histories, SurfaceModel& model);

}  // namespace emit::renderer
