// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_double4.hpp>
#include <optional>

namespace emit::renderer {

/// Volume that the camera can see, in relworld axes (east, north, up; origin at the camera),
/// metres, double precision. It is a pyramid cut at `near_m` and `far_m` along the boresight, and
/// the box that holds all surfaces.
struct ViewVolume {
  glm::dmat3 relworld_from_sensor{1.0};
  glm::dmat4 clip_from_relworld{1.0};  ///< reversed depth, infinite far plane
  double tan_half_h = 0.1;             ///< tangent of half the horizontal field of view
  double tan_half_v = 0.1;             ///< tangent of half the vertical field of view
  /// Tangents that bound the drawn part, where less than all is drawn: smallest to the right and
  /// down, then largest to the right and down.
  std::optional<glm::dvec4> drawn_tan = std::nullopt;
  double near_m = 0.1;
  double far_m = 1e5;
  glm::dvec3 scene_min_m{0.0};  ///< box around all receivers
  glm::dvec3 scene_max_m{0.0};
  glm::dvec3 casters_min_m{0.0};  ///< box around all casters at the instant of the light
  glm::dvec3 casters_max_m{0.0};
};

/// One orthographic light frustum. Light coordinates of a point p are dot(axes[i], p) +
/// offset_m[i], in metres: right and down from the first corner of the map, and depth from the near
/// plane.
struct LightFrustum {
  std::array<glm::dvec3, 3> axes;  ///< right, down, away from the sun; unit length, relworld
  glm::dvec3 offset_m{0.0};
  glm::dvec3 extent_m{1.0};
  double end_boresight_m = 0.0;  ///< the frustum serves receivers nearer than this
};

/// Light frusta of one instant, from near to far.
struct LightFrusta {
  std::array<LightFrustum, 4> cascades;
  std::uint32_t count = 0;  ///< 0: nothing is visible
};

/// Fits light frusta around the visible part of the scene's box. A frustum is the smallest
/// rectangle in any orientation about the sun's direction. The view is split along the boresight
/// until a texel at the near end of each part is at most as large as a pixel there, or until
/// `max_cascades` is reached. `margin_m` widens every side for filter taps. The depth range covers
/// the boxes of receivers and casters, so no caster is cut off. RT-safe: memory is fixed.
/// @pre `to_sun` is of unit length, map_px >= 1, margin_m >= 0.
[[nodiscard]] LightFrusta fit_light(const ViewVolume& view, const glm::dvec3& to_sun,
                                    std::uint32_t map_px, std::uint32_t max_cascades,
                                    double margin_m, double pixel_rad) noexcept;

/// Range of boresight distance over which the view pyramid meets the scene's box. Returns false,
/// and leaves the outputs without meaning, when they do not meet. RT-safe.
[[nodiscard]] bool visible_depth_range_m(const ViewVolume& view, double& near_m,
                                         double& far_m) noexcept;

}  // namespace emit::renderer
