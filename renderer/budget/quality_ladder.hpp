// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/renderer/renderer.hpp"
#include "surface/mesh/cluster_levels.hpp"

namespace emit::renderer {

/// Quality level of a frame. A lower level renders fewer, larger pixels and interpolates between
/// them, and it draws coarser surfaces.
struct QualityLevel {
  double scale_frac =
      1.0;             ///< width and height of the rendered image divided by the output image's
  LevelLimits limits;  ///< error limits of surfaces in rendered pixels, without pixel_rad
};

/// Limit in pixels that switches an error off, for triangles whose values do not matter. Their
/// outlines alone keep them small.
inline constexpr double kAnyPx = 1e6;

/// Quality levels from full quality, number 0, to the coarsest. The numbers (`quality_level` in the
/// interface) are part of recordings, because a replay renders the level that was recorded.
inline constexpr std::array<QualityLevel, 12> kQualityLadder = {{
    {1.0, {0.0, 0.25, 4.0, 0.5, 0}},
    {1.0, {0.0, 0.5, 8.0, 1.0, 1}},
    {1.0, {0.0, 1.0, 16.0, 2.0, 2}},
    {1.0, {0.0, 2.0, 32.0, 4.0, 3}},
    {1.0, {0.0, 4.0, 64.0, 8.0, 4}},
    {0.75, {0.0, 1.0, 16.0, 2.0, 2}},
    {0.75, {0.0, 2.0, 32.0, 4.0, 3}},
    {0.5, {0.0, 1.0, 16.0, 2.0, 3}},
    {0.5, {0.0, 2.0, 32.0, 4.0, 4}},
    {0.33, {0.0, 2.0, 32.0, 4.0, 4}},
    {0.25, {0.0, 4.0, 64.0, 8.0, 4}},
    {0.25, {0.0, 4.0, kAnyPx, kAnyPx, 4}},
}};
/// True when the level renders fewer pixels than the output image has. It then needs EnlargePass.
[[nodiscard]] constexpr bool is_scaled(const QualityLevel& level) noexcept {
  return level.scale_frac < 1.0;
}
/// Columns and rows of the image that a level renders for an output image, at least 1 x 1.
[[nodiscard]] glm::uvec2 rendered_px(const QualityLevel& level,
                                     const glm::uvec2& output_px) noexcept;

/// Number of pixels of the image that a level renders for an output image.
[[nodiscard]] inline double rendered_pixels(const QualityLevel& level,
                                            const glm::uvec2& output_px) noexcept {
  const glm::uvec2 px = rendered_px(level, output_px);
  return static_cast<double>(px.x) * px.y;
}
/// Number of triangles that each quality level draws of a frame.
using TrianglesPerLevel = std::array<std::uint32_t, kQualityLadder.size()>;

/// Times and errors of every quality level, measured where the camera is going to be.
class LadderMap {
 public:
  using PerLevel = std::array<QualityLevelStats, kQualityLadder.size()>;

  /// Adds a measured position of the camera, in the order of its trajectory. Setup only.
  void add(const physics::Pose& camera, const PerLevel& levels);
  [[nodiscard]] bool empty() const noexcept { return places_.empty(); }

  /// Interpolates between the measured position that is nearest to `camera` and its nearer
  /// neighbour on the trajectory. Returns false, and the medians of all positions, when nothing was
  /// measured near: the camera is farther away than these two are from each other, or it looks away
  /// from the measured direction by more than half of `fov_rad`. RT-safe.
  /// @pre fov_rad > 0
  [[nodiscard]] bool at(const physics::Pose& camera, double fov_rad,
                        PerLevel& levels) const noexcept;

 private:
  struct Place {
    physics::Pose camera;
    PerLevel levels;
  };
  std::vector<Place> places_;
  PerLevel medians_{};
};

}  // namespace emit::renderer
