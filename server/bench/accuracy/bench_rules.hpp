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

/// Shares of all pixels of the image that parts of the benchmark scene fill.
struct SceneFill {
  double surface_frac = 0.0;  ///< anything but sky
  double figure_frac = 0.0;   ///< all that rises above the ground plane z = 0
  /// Ground more than 1 K below the warmest ground in the image: shaded now or some time before.
  double swept_ground_frac = 0.0;
};

/// Smallest shares that the published tables require of an image. The figure counts for the statue
/// alone.
inline constexpr double kMinSurfaceFrac = 0.80;
inline constexpr double kMinFigureFrac = 0.25;
inline constexpr double kMinSweptFrac = 0.15;
/// Smallest size of every image, and the smallest number of pixels whose error is computed.
inline constexpr std::uint32_t kMinWidthPx = 1024;
inline constexpr std::uint32_t kMinHeightPx = 768;
inline constexpr std::uint32_t kMinErrorPixels = 20'000;
/// Largest ratio of the time of a per-frame image to the time in which Embree traces the steps of
/// its history.
inline constexpr double kMaxEmbreeRatio = 6.0;

/// Measures the shares in one image. `depth_m` is the distance along the boresight, +Inf in the
/// sky; `temperature_k` is as rendered.
/// @pre both have width_px * height_px values
[[nodiscard]] SceneFill measure_fill(const scene::SensorDesc& sensor, const physics::Pose& pose,
                                     std::span<const float> depth_m,
                                     std::span<const float> temperature_k);

/// Returns the smaller of each share, for frames between which the camera and the clock move.
[[nodiscard]] SceneFill least_of(const SceneFill& a, const SceneFill& b) noexcept;

/// Returns one line per rule that the image breaks; empty when it meets all.
[[nodiscard]] std::vector<std::string> broken_rules(const SceneFill& fill, bool statue);
/// Returns one line per rule that the options of a run break. `error_pixels` is the number per
/// image; empty where no error is computed.
[[nodiscard]] std::vector<std::string> broken_rules(std::uint32_t width_px, std::uint32_t height_px,
                                                    std::optional<std::uint32_t> error_pixels);

}  // namespace emit::tool
