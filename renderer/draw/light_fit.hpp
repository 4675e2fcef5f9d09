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

/// What the camera can see: pyramid from the origin of relworld, cut at `near_m` and `far_m` along
/// the boresight, and the box that holds all surfaces. Double, metres, relworld axes.
struct ViewVolume {
  glm::dmat3 relworld_from_sensor{1.0};
  glm::dmat4 clip_from_relworld{1.0};  ///< reversed depth, infinite far plane
  double tan_half_h = 0.1;
  double tan_half_v = 0.1;
  /// Where less than all of it is drawn: least tangents to the right and down, then the greatest.
  std::optional<glm::dvec4> drawn_tan = std::nullopt;
  double near_m = 0.1;
  double far_m = 1e5;
  glm::dvec3 scene_min_m{0.0};  ///< box around all receivers, relative to the camera
  glm::dvec3 scene_max_m{0.0};
  glm::dvec3 casters_min_m{0.0};  ///< box around all casters at the light's instant
  glm::dvec3 casters_max_m{0.0};
};

/// One orthographic light frustum: rows of light_from_relworld (right, down, away from the sun)
/// with the offsets that put the origin at the map's first corner on the near plane.
struct LightFrustum {
  std::array<glm::dvec3, 3> axes;
  glm::dvec3 offset_m{0.0};
  glm::dvec3 extent_m{1.0};
  double end_boresight_m = 0.0;  ///< receivers nearer than this belong to it
};

struct LightFrusta {
  std::array<LightFrustum, 4> cascades;
  std::uint32_t count = 0;  ///< 0: nothing visible
};

/// Fits the smallest rectangle (in any orientation about the sun's direction) around the visible
/// part of the scene's box, and splits it along the boresight until a texel at the near end is at
/// most a pixel there, or `max_cascades` is reached. `margin_m` widens every side for filter taps.
/// The depth range covers both boxes, so that no caster is cut off.
/// RT-safe: fixed memory.
[[nodiscard]] LightFrusta fit_light(const ViewVolume& view, const glm::dvec3& to_sun,
                                    std::uint32_t map_px, std::uint32_t max_cascades,
                                    double margin_m, double pixel_rad) noexcept;

/// Range of boresight distance over which the view pyramid meets the box; false if it does not.
[[nodiscard]] bool visible_depth_range_m(const ViewVolume& view, double& near_m,
                                         double& far_m) noexcept;

}  // namespace emit::renderer
