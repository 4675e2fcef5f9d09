// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint4.hpp>

#include "emit/scene/scene_desc.hpp"

/// Windows of an image. A window is the part of an image that a frame is requested for, as
/// FrameParams holds it: first column, first row, end column, end row, where the ends are one past
/// the last.
namespace emit::renderer {

/// Columns and rows of a window.
[[nodiscard]] inline glm::uvec2 window_size_px(const glm::uvec4& window_px) noexcept {
  return {window_px.z - window_px.x, window_px.w - window_px.y};
}

/// Window that the rectangle `rect` describes. An empty rectangle, or one that does not fit into
/// the image, gives the whole image.
[[nodiscard]] inline glm::uvec4 window_of(const scene::PixelRect& rect,
                                          const glm::uvec2& image_px) noexcept {
  const bool fits = !rect.empty() && rect.x_px < image_px.x && rect.y_px < image_px.y &&
                    rect.width_px <= image_px.x - rect.x_px &&
                    rect.height_px <= image_px.y - rect.y_px;
  if (!fits) return {0U, 0U, image_px.x, image_px.y};
  return {rect.x_px, rect.y_px, rect.x_px + rect.width_px, rect.y_px + rect.height_px};
}

/// Part of the rendered image that the passes must compute for a window of the output image. It is
/// the window itself where both images have the same size. Otherwise it includes the neighbours
/// that the enlargement interpolates between.
[[nodiscard]] inline glm::uvec4 rendered_window(const glm::uvec4& output_window_px,
                                                const glm::uvec2& output_px,
                                                const glm::uvec2& rendered_px) noexcept {
  if (rendered_px == output_px) return output_window_px;
  constexpr std::uint64_t kNeighbours = 2;
  const auto first = [](std::uint64_t place, std::uint64_t output, std::uint64_t rendered) {
    const std::uint64_t at = place * rendered / output;
    return static_cast<std::uint32_t>(at > kNeighbours ? at - kNeighbours : 0);
  };
  const auto end = [](std::uint64_t place, std::uint64_t output, std::uint64_t rendered) {
    const std::uint64_t at = (place * rendered + output - 1) / output;
    return static_cast<std::uint32_t>(std::min(at + kNeighbours, rendered));
  };
  return {first(output_window_px.x, output_px.x, rendered_px.x),
          first(output_window_px.y, output_px.y, rendered_px.y),
          end(output_window_px.z, output_px.x, rendered_px.x),
          end(output_window_px.w, output_px.y, rendered_px.y)};
}

}  // namespace emit::renderer
