// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// How the benchmark scene fills the picture, as shares of all its pixels.
struct SceneFill {
  double surface_frac = 0.0;  ///< anything but sky
  double figure_frac = 0.0;   ///< what rises above the ground plane z = 0
  /// Ground more than 1 K below the warmest ground in the picture: shaded now or some time before.
  double swept_ground_frac = 0.0;
};

/// What the published tables ask of a picture. The figure counts for the statue alone.
inline constexpr double kLeastSurfaceFrac = 0.80;
inline constexpr double kLeastFigureFrac = 0.25;
inline constexpr double kLeastSweptFrac = 0.15;
/// Of every picture, and of those whose error is computed.
inline constexpr std::uint32_t kLeastWidthPx = 1024;
inline constexpr std::uint32_t kLeastHeightPx = 768;
inline constexpr std::uint32_t kLeastErrorPixels = 20'000;
/// A per-frame picture may take this many times what Embree takes to trace its history's steps.
inline constexpr double kMostEmbreeRatio = 6.0;

/// Shares in one picture. `depth_m` along the boresight, +Inf in the sky; `temperature_k` as
/// rendered. Precondition: both have width_px * height_px values.
[[nodiscard]] SceneFill measure_fill(const scene::SensorDesc& sensor, const physics::Pose& pose,
                                     std::span<const float> depth_m,
                                     std::span<const float> temperature_k);

/// The smallest shares over some frames: the camera and the clock move.
[[nodiscard]] SceneFill least_of(const SceneFill& a, const SceneFill& b) noexcept;

/// One line per rule that is not met; empty when all are.
[[nodiscard]] std::vector<std::string> broken_rules(const SceneFill& fill, bool statue);
/// Of what a run is asked for. `error_pixels` per picture; none where no error is computed.
[[nodiscard]] std::vector<std::string> broken_rules(std::uint32_t width_px, std::uint32_t height_px,
                                                    std::optional<std::uint32_t> error_pixels);

}  // namespace emit::tool
