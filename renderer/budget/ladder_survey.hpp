// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <glm/ext/vector_uint2.hpp>
#include <span>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/renderer/renderer.hpp"
#include "budget/frame_cost.hpp"
#include "budget/quality_ladder.hpp"

namespace emit::renderer {

/// What is surveyed. The renderer is warm and free of frames in flight.
struct LadderSubject {
  Renderer& renderer;
  const scene::SensorDesc& sensor;
  std::span<const physics::ApparentTemperature> apparent;  ///< by band
  glm::uvec2 picture_px;
  std::function<TrianglesOfRungs(const FrameRequest&)> triangles;
};

struct LadderSurvey {
  LadderMap map;   ///< of the camera's way
  FrameCost cost;  ///< anywhere
};

/// Renders every rung where the camera is going to be: at `first` and along the rest of the
/// scenario's trajectory; where it stands still, the times of other directions too. Takes a hundred
/// to two hundred frames' time. Setup.
/// Errors: gpu (the driver failed), internal (stopped by `progress`).
[[nodiscard]] physics::Result<LadderSurvey> survey_ladder(const LadderSubject& subject,
                                                          const FrameRequest& first,
                                                          const WarmUpProgress& progress);

}  // namespace emit::renderer
