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

/// What a frame of less than full quality sheds: pixels are rendered larger and interpolated, and
/// surfaces are coarser, counted in these pixels.
struct QualityRung {
  double scale_frac = 1.0;  ///< of the picture's width and height
  LevelLimits limits;       ///< but for pixel_rad
};

/// Of triangles whose values do not matter: outlines alone keep them small.
inline constexpr double kAnyPx = 1e6;

/// Rung 0 is full quality. The numbers of the rungs are part of recordings: a replay renders them.
inline constexpr std::array<QualityRung, 12> kQualityLadder = {{
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
/// Rungs that render another number of pixels need memory and a pass of their own.
[[nodiscard]] constexpr bool is_scaled(const QualityRung& rung) noexcept {
  return rung.scale_frac < 1.0;
}
/// Pixels that a rung renders of a picture.
[[nodiscard]] glm::uvec2 rendered_px(const QualityRung& rung,
                                     const glm::uvec2& picture_px) noexcept;

[[nodiscard]] inline double rendered_pixels(const QualityRung& rung,
                                            const glm::uvec2& picture_px) noexcept {
  const glm::uvec2 px = rendered_px(rung, picture_px);
  return static_cast<double>(px.x) * px.y;
}
/// Triangles that each rung draws of a frame.
using TrianglesOfRungs = std::array<std::uint32_t, kQualityLadder.size()>;

/// What every rung is worth, measured where the camera is going to be.
class LadderMap {
 public:
  using OfRungs = std::array<RungStats, kQualityLadder.size()>;

  /// In the order of the camera's way. Setup only.
  void add(const physics::Pose& camera, const OfRungs& rungs);
  [[nodiscard]] bool empty() const noexcept { return places_.empty(); }

  /// Between the two measured places that are nearest on the way. False where none was measured
  /// near by, farther off than the way between places, or looking another way by more than half of
  /// `fov_rad`: then medians of all places. RT-safe.
  [[nodiscard]] bool at(const physics::Pose& camera, double fov_rad, OfRungs& rungs) const noexcept;

 private:
  struct Place {
    physics::Pose camera;
    OfRungs rungs;
  };
  std::vector<Place> places_;
  OfRungs medians_{};
};

}  // namespace emit::renderer
