// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <glm/ext/vector_uint2.hpp>
#include <span>

#include "budget/frame_cost.hpp"
#include "budget/quality_ladder.hpp"
#include "emit/physics/apparent_temperature.hpp"
#include "emit/renderer/renderer.hpp"

namespace emit::renderer {

/// Renderer and scenario that are surveyed. The renderer is warmed up and has no frame in flight.
struct LadderSubject {
  Renderer& renderer;
  const scene::SensorDesc& sensor;
  std::span<const physics::ApparentTemperature> apparent;  ///< one entry per band
  glm::uvec2 output_px;                                    ///< size of the output image
  /// Number of triangles that each quality level draws of a frame.
  std::function<TrianglesPerLevel(const FrameRequest&)> triangles;
};

/// Result of a survey.
struct LadderSurvey {
  LadderMap map;   ///< times and errors along the trajectory of the camera
  FrameCost cost;  ///< times anywhere else
};

/// Renders every quality level where the camera is going to be: at `first` and along the rest of
/// the scenario's trajectory. Without a trajectory it also times other directions of the camera.
/// The survey takes the time of one to two hundred frames. Setup only. Errors: gpu (the driver
/// failed), internal (`progress` asked to stop).
/// @pre `subject.triangles` can be called, and there is one entry of `subject.apparent` per band.
[[nodiscard]] physics::Result<LadderSurvey> survey_ladder(const LadderSubject& subject,
                                                          const FrameRequest& first,
                                                          const WarmUpProgress& progress);

}  // namespace emit::renderer
