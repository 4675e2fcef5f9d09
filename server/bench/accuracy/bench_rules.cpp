// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/bench_rules.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "emit/physics/check.hpp"

namespace emit::tool {
namespace {

/// Height above which a surface belongs to the figure: far above the error of float depth, far
/// below its height.
constexpr double kGroundM = 0.02;
constexpr double kSweptK = 1.0;

}  // namespace

SceneFill measure_fill(const scene::SensorDesc& sensor, const physics::Pose& pose,
                       std::span<const float> depth_m, std::span<const float> temperature_k) {
  const std::size_t count = std::size_t{sensor.width_px} * sensor.height_px;
  EMIT_CHECK_OP(depth_m.size(), ==, count);
  EMIT_CHECK_OP(temperature_k.size(), ==, count);
  const double scale = 2.0 * std::tan(0.5 * sensor.fov_h_rad) / sensor.width_px;
  const glm::dvec3 forward = pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  const glm::dvec3 right = pose.world_from_body * glm::dvec3(0.0, 1.0, 0.0);
  const glm::dvec3 down = pose.world_from_body * glm::dvec3(0.0, 0.0, 1.0);
  std::size_t surface = 0;
  std::size_t figure = 0;
  std::vector<double> ground_k;
  for (std::uint32_t row = 0; row < sensor.height_px; ++row) {
    for (std::uint32_t column = 0; column < sensor.width_px; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * sensor.width_px + column;
      const double depth = static_cast<double>(depth_m[i]);
      if (!std::isfinite(depth)) continue;
      ++surface;
      const double across = scale * (column + 0.5 - 0.5 * sensor.width_px);
      const double along = scale * (row + 0.5 - 0.5 * sensor.height_px);
      const double z_m =
          pose.position_world_m.z + depth * (forward.z + across * right.z + along * down.z);
      if (z_m > kGroundM) {
        ++figure;
      } else if (const double kelvin = static_cast<double>(temperature_k[i]);
                 std::isfinite(kelvin)) {
        ground_k.push_back(kelvin);
      }
    }
  }
  SceneFill fill;
  const double pixels = static_cast<double>(sensor.width_px) * sensor.height_px;
  fill.surface_frac = static_cast<double>(surface) / pixels;
  fill.figure_frac = static_cast<double>(figure) / pixels;
  if (!ground_k.empty()) {
    const double warmest_k = *std::max_element(ground_k.begin(), ground_k.end());
    fill.swept_ground_frac =
        static_cast<double>(
            std::count_if(ground_k.begin(), ground_k.end(),
                          [warmest_k](double kelvin) { return kelvin < warmest_k - kSweptK; })) /
        pixels;
  }
  return fill;
}

SceneFill least_of(const SceneFill& a, const SceneFill& b) noexcept {
  return {std::min(a.surface_frac, b.surface_frac), std::min(a.figure_frac, b.figure_frac),
          std::min(a.swept_ground_frac, b.swept_ground_frac)};
}

std::vector<std::string> broken_rules(const SceneFill& fill, bool statue) {
  std::vector<std::string> broken;
  const auto check = [&broken](const char* what, double share, double least) {
    if (share < least) {
      broken.push_back(fmt::format("{} {:.1f} % of the picture, the rule is {:.0f} %", what,
                                   100.0 * share, 100.0 * least));
    }
  };
  check("surfaces fill", fill.surface_frac, kMinSurfaceFrac);
  if (statue) check("the statue fills", fill.figure_frac, kMinFigureFrac);
  check("ground swept by the shadow fills", fill.swept_ground_frac, kMinSweptFrac);
  return broken;
}

std::vector<std::string> broken_rules(std::uint32_t width_px, std::uint32_t height_px,
                                      std::optional<std::uint32_t> error_pixels) {
  std::vector<std::string> broken;
  if (width_px < kMinWidthPx || height_px < kMinHeightPx) {
    broken.push_back(fmt::format("pictures of {}x{}, the rule is {}x{} at least", width_px,
                                 height_px, kMinWidthPx, kMinHeightPx));
  }
  if (error_pixels.value_or(kMinErrorPixels) < kMinErrorPixels) {
    broken.push_back(fmt::format("errors of {} pixels, the rule is {} at least", *error_pixels,
                                 kMinErrorPixels));
  }
  return broken;
}

}  // namespace emit::tool
