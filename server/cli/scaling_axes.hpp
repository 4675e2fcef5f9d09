// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::cli {

/// One scene of an axis of `emit bench scaling`. Its method is "cached", model foster.
struct ScalingCase {
  double value = 0.0;  ///< axis "samples": known after the warm-up only
  scene::ScenarioDesc scenario;
};

/// Scenes that differ in one quantity.
struct ScalingAxis {
  std::string name;
  std::vector<ScalingCase> cases;
  /// Most that a frame may take of what it takes in the case before.
  std::optional<double> limit_ratio;
};

/// steps, triangles, pixels, objects, samples.
[[nodiscard]] std::vector<std::string> scaling_axes();

/// Makes the scenes of an axis. Geometry that no shipped scene has is generated into `folder`.
/// `quick`: small ones. Setup only. Errors: those of the scenario's loader and of the generator.
[[nodiscard]] physics::Result<ScalingAxis> make_scaling_axis(const std::string& name, bool quick,
                                                             const std::filesystem::path& folder);

/// Frames of three renderers in turn: a, its twin of the same scene, and b.
struct PairedRatio {
  std::size_t pairs = 0;
  double ratio = 0.0;  ///< median of b / a
  double self_ratio = 0.0;
  /// How far the medians of thirds of the pairs of a and its twin lie from 1.
  double self_spread = 0.0;

  /// At most `limit_ratio`, or no farther above 1 than a run lies from itself.
  [[nodiscard]] bool within(double limit_ratio) const noexcept;
};
/// @pre the three have the same number of frames, at least 3; all times > 0
[[nodiscard]] PairedRatio paired_ratio(std::span<const double> a_ms,
                                       std::span<const double> twin_ms,
                                       std::span<const double> b_ms);

}  // namespace emit::cli
