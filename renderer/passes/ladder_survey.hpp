// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/renderer/renderer.hpp"
#include "passes/quality_ladder.hpp"

namespace emit::renderer {

/// Renders every rung where the camera is going to be: at `first` and along the rest of the
/// scenario's trajectory. `apparent`: by band. Takes two hundred frames' time. Setup; the renderer
/// is warm and free of frames in flight.
/// Errors: gpu (the driver failed), internal (stopped by `progress`).
[[nodiscard]] physics::Result<LadderMap> survey_ladder(
    Renderer& renderer, const scene::SensorDesc& sensor,
    std::span<const physics::ApparentTemperature> apparent, const FrameRequest& first,
    const WarmUpProgress& progress);

}  // namespace emit::renderer
