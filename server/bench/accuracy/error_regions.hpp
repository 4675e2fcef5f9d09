// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <string_view>
#include <vector>

#include "emit/reference/solve.hpp"
#include "emit/reference/visibility.hpp"

namespace emit::tool {

/// Parts of an image whose errors have different causes and are reported apart.
enum class Region : std::uint8_t {
  all,       ///< every surface pixel
  sunlit,    ///< the whole sun is seen, away from shadow boundaries and edges
  core,      ///< none of the sun is seen, away from shadow boundaries and edges
  penumbra,  ///< part of the sun is seen, or a shadow boundary is near; away from edges
  edges      ///< near an edge, a corner or a foot of an object, or an outline in the image
};
inline constexpr std::array<Region, 5> kRegions{Region::all, Region::sunlit, Region::core,
                                                Region::penumbra, Region::edges};
[[nodiscard]] std::string_view name_of(Region region) noexcept;

struct RegionOptions {
  /// Distance from an edge within which lateral conduction counts: a layer's thickness. With 0 only
  /// the pixels that touch an edge count.
  double edge_m = 0.0;
  double shadow_boundary_m = 0.05;  ///< distance from a partly lit point
};

/// Returns one mask per entry of kRegions, each as long as the image. Rays through the pixels'
/// centres find point and normal. If `to_sun` is below the horizon, every pixel is core.
[[nodiscard]] std::array<std::vector<std::uint8_t>, kRegions.size()> classify_pixels(
    const reference::SceneInstant& scene, const reference::SolveView& view,
    const glm::dvec3& to_sun, const RegionOptions& options);

/// Differences of an image to the reference over a mask.
struct ErrorSummary {
  std::uint64_t pixels = 0;
  std::uint64_t not_finite =
      0;  ///< where the truth is finite and the picture is not; left out below
  double max = 0.0;
  double rms = 0.0;
  double p99 = 0.0;
  double mean = 0.0;  ///< signed
};
/// Computes absolute differences, or differences relative to the reference. Pixels whose reference
/// is not finite do not count.
/// @pre equal sizes
[[nodiscard]] ErrorSummary summarize_error(std::span<const float> picture,
                                           std::span<const float> truth,
                                           std::span<const std::uint8_t> mask, bool relative);

}  // namespace emit::tool
