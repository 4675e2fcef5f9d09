// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>

#include "emit/protocol/output_geometry.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Returns a window with a margin on all sides, as far as the image has it. RT-safe.
[[nodiscard]] inline scene::PixelRect grown(const scene::PixelRect& window, std::uint32_t margin_px,
                                            const protocol::ImageSize& image) noexcept {
  const std::uint32_t left = std::min(window.x_px, margin_px);
  const std::uint32_t top = std::min(window.y_px, margin_px);
  const std::uint32_t right = std::min(image.width_px - window.x_px - window.width_px, margin_px);
  const std::uint32_t bottom =
      std::min(image.height_px - window.y_px - window.height_px, margin_px);
  return {window.x_px - left, window.y_px - top, window.width_px + left + right,
          window.height_px + top + bottom};
}

}  // namespace emit::server
