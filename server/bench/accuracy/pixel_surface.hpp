// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>

#include "emit/reference/solve.hpp"
#include "emit/reference/visibility.hpp"

namespace emit::tool {

/// Surface point that the ray through a pixel's centre meets.
struct PixelSurface {
  bool surface = false;  ///< false: sky
  std::uint32_t object = 0;
  std::uint32_t material = 0;
  std::uint32_t entity = reference::kNoEntity;
  double distance_m = 0.0;  ///< along the ray
  glm::dvec3 position_m{0.0};
  glm::dvec3 normal{0.0};          ///< of the face, towards the camera
  glm::dvec3 shading_normal{0.0};  ///< interpolated; the face's where that one looks away
};
[[nodiscard]] PixelSurface trace_pixel(const reference::SceneInstant& scene,
                                       const reference::SolveView& view, std::uint32_t column,
                                       std::uint32_t row);

/// Returns the angle that a pixel in the middle of the image covers.
[[nodiscard]] double pixel_rad(const reference::SolveView& view) noexcept;

/// Returns true when an outline runs between two neighbouring pixels: another object, or a step in
/// depth beyond the tangent plane.
[[nodiscard]] bool is_outline(const PixelSurface& a, const PixelSurface& b,
                              double width_rad) noexcept;

}  // namespace emit::tool
