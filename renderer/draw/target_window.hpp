// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_uint2.hpp>

#include "draw/light_fit.hpp"
#include "emit/scene/mesh.hpp"

/// Windows of small targets. An entity whose image is a few pixels wide is not drawn into the
/// image, because one sample per pixel loses or doubles much of it. It is drawn into a window that
/// fits around it, with a fixed number of samples across however small it is, and the samples are
/// averaged over the pixels (passes/target_pass.hpp).
namespace emit::renderer {

/// Part of a list of draws.
struct CommandRange {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// Window around one small target. It may lie partly outside the image.
struct TargetWindow {
  std::uint32_t entity = 0;   ///< index of the spans that DrawLists::begin() takes
  std::uint32_t object = 0;   ///< index of the scenario's object
  glm::dvec2 first_px{0.0};   ///< corner in pixels of the output image
  glm::dvec2 end_px{0.0};     ///< opposite corner
  double farthest_m = 0.0;    ///< boresight distance that no point of the target exceeds
  glm::uvec2 samples{0};      ///< across and down
  CommandRange single_sided;  ///< draws of the target and of what may hide it
  CommandRange double_sided;

  [[nodiscard]] glm::dvec2 size_px() const noexcept { return end_px - first_px; }
};

/// Samples across a window, by the size of its longer side. The window fits closely, so that the
/// sampling of a target stays the same while it drifts and grows.
[[nodiscard]] std::uint32_t window_samples(double size_px) noexcept;

/// Widens the window by a box that `relworld_from_box` places. Returns false when the box reaches
/// behind the near plane. `size_px` is the output image. The first box makes an empty window, whose
/// corners are infinite, a window.
[[nodiscard]] bool add_box(TargetWindow& window, const ViewVolume& view,
                           const glm::dmat4& relworld_from_box, const scene::Aabb& box,
                           const glm::uvec2& size_px) noexcept;

/// View of the camera through the window alone: clip space covers the window.
[[nodiscard]] ViewVolume view_through(const TargetWindow& window, const ViewVolume& view,
                                      const glm::uvec2& size_px) noexcept;

}  // namespace emit::renderer
