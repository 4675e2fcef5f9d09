// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// One scene of an axis of `emit bench scaling`. Its method is "cached", model foster.
struct ScalingCase {
  double value = 0.0;  ///< axis "samples": known after the warm-up only
  scene::ScenarioDesc scenario;
};

/// Scenes that differ in one quantity.
struct ScalingAxis {
  std::string name;
  std::vector<ScalingCase> cases;
  /// Largest ratio of the frame time to that of the case before.
  std::optional<double> limit_ratio;
};

/// Returns the names of the axes: steps, triangles, pixels, objects, samples.
[[nodiscard]] std::vector<std::string> scaling_axes();

/// Makes the scenes of an axis. Geometry that no shipped scene has is generated into `folder`. With
/// `quick` they are small. Setup only. Errors: those of the scenario's loader and of the generator.
[[nodiscard]] physics::Result<ScalingAxis> make_scaling_axis(const std::string& name, bool quick,
                                                             const std::filesystem::path& folder);

}  // namespace emit::tool
