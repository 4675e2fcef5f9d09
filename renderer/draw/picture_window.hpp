// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint4.hpp>

#include "emit/scene/scene_desc.hpp"

/// The part of a picture that a frame is for, as FrameParams has it: first column and row, then the
/// ones behind the last.
namespace emit::renderer {

[[nodiscard]] inline glm::uvec2 window_size_px(const glm::uvec4& window_px) noexcept {
  return {window_px.z - window_px.x, window_px.w - window_px.y};
}

/// All of the picture where `rect` is empty or does not fit.
[[nodiscard]] inline glm::uvec4 window_of(const scene::PixelRect& rect,
                                          const glm::uvec2& picture_px) noexcept {
  const bool fits = !rect.empty() && rect.x_px < picture_px.x && rect.y_px < picture_px.y &&
                    rect.width_px <= picture_px.x - rect.x_px &&
                    rect.height_px <= picture_px.y - rect.y_px;
  if (!fits) return {0U, 0U, picture_px.x, picture_px.y};
  return {rect.x_px, rect.y_px, rect.x_px + rect.width_px, rect.y_px + rect.height_px};
}

/// What of `format_px` pixels is wanted so that a window of the `picture_px` can be made of them:
/// the same, or with the neighbours between which an enlarged picture is interpolated.
[[nodiscard]] inline glm::uvec4 rendered_window(const glm::uvec4& window_px,
                                                const glm::uvec2& picture_px,
                                                const glm::uvec2& format_px) noexcept {
  if (format_px == picture_px) return window_px;
  constexpr std::uint64_t kNeighbours = 2;
  const auto first = [](std::uint64_t place, std::uint64_t picture, std::uint64_t format) {
    const std::uint64_t at = place * format / picture;
    return static_cast<std::uint32_t>(at > kNeighbours ? at - kNeighbours : 0);
  };
  const auto end = [](std::uint64_t place, std::uint64_t picture, std::uint64_t format) {
    const std::uint64_t at = (place * format + picture - 1) / picture;
    return static_cast<std::uint32_t>(std::min(at + kNeighbours, format));
  };
  return {first(window_px.x, picture_px.x, format_px.x),
          first(window_px.y, picture_px.y, format_px.y),
          end(window_px.z, picture_px.x, format_px.x), end(window_px.w, picture_px.y, format_px.y)};
}

}  // namespace emit::renderer
