// SPDX-License-Identifier: Apache-2.0
#include "draw/target_window.hpp"

#include <glm/common.hpp>
#include <glm/ext/vector_double4.hpp>

#include <algorithm>

#include "shared/bindings.glsl.h"

namespace emit::renderer {
namespace {

/// Largest window that has half of the samples. Above it the window would have fewer than four
/// samples along the side of a pixel.
constexpr double kCoarseWindowPx = EMIT_TARGET_SIDE / 8.0;

}  // namespace

std::uint32_t window_samples(double size_px) noexcept {
  return size_px <= kCoarseWindowPx ? EMIT_TARGET_SIDE / 2U : EMIT_TARGET_SIDE;
}

bool add_box(TargetWindow& window, const ViewVolume& view, const glm::dmat4& relworld_from_box,
             const scene::Aabb& box, const glm::uvec2& size_px) noexcept {
  const glm::dmat4 clip_from_box = view.clip_from_relworld * relworld_from_box;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const glm::dvec4 clip =
        clip_from_box * glm::dvec4((corner & 1U) != 0U ? box.max_m.x : box.min_m.x,
                                   (corner & 2U) != 0U ? box.max_m.y : box.min_m.y,
                                   (corner & 4U) != 0U ? box.max_m.z : box.min_m.z, 1.0);
    if (!(clip.w > view.near_m)) return false;
    const glm::dvec2 px = 0.5 * (glm::dvec2(clip) / clip.w + 1.0) * glm::dvec2(size_px);
    window.first_px = glm::min(window.first_px, px);
    window.end_px = glm::max(window.end_px, px);
    window.farthest_m = std::max(window.farthest_m, clip.w);
  }
  return true;
}

ViewVolume view_through(const TargetWindow& window, const ViewVolume& view,
                        const glm::uvec2& size_px) noexcept {
  ViewVolume through = view;
  // Bound the view by the window, as tangents.
  const glm::dvec2 half_tan(view.tan_half_h, view.tan_half_v);
  const glm::dvec2 low = 2.0 * window.first_px / glm::dvec2(size_px) - 1.0;
  const glm::dvec2 high = 2.0 * window.end_px / glm::dvec2(size_px) - 1.0;
  through.drawn_tan = glm::dvec4(low * half_tan, high * half_tan);
  // Enlarge the window to all of clip space. This is done in double, because the window may be a
  // millionth of the image.
  const glm::dvec2 middle = 0.5 * (low + high);
  const glm::dvec2 scale = 2.0 / (high - low);
  const glm::dmat4 window_from_clip{{scale.x, 0.0, 0.0, 0.0},
                                    {0.0, scale.y, 0.0, 0.0},
                                    {0.0, 0.0, 1.0, 0.0},
                                    {-middle.x * scale.x, -middle.y * scale.y, 0.0, 1.0}};
  through.clip_from_relworld = window_from_clip * view.clip_from_relworld;
  return through;
}

}  // namespace emit::renderer
