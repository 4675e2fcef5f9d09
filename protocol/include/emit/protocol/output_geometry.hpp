// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/protocol/frame_header.hpp"

/// Geometry of frames whose pixels do not lie as in the sensor's image (docs/wire.md section 3).
namespace emit::protocol {

/// A place in an image, px from its top left corner, right and down. The centre of the first pixel
/// is at (0.5, 0.5).
struct ImagePoint {
  double x_px = 0.0;
  double y_px = 0.0;
  [[nodiscard]] bool operator==(const ImagePoint&) const = default;
};

/// Size of an image, px.
struct ImageSize {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  [[nodiscard]] bool operator==(const ImageSize&) const = default;
};

/// Returns whether the steps exchange rows and columns. RT-safe.
[[nodiscard]] constexpr bool exchanges_sides(std::uint16_t output_steps) noexcept {
  return (output_steps & kOutputRotated90) != 0;
}

/// Returns the size of a window's picture after mirror and rotation. RT-safe.
[[nodiscard]] constexpr ImageSize turned_size(std::uint16_t output_steps,
                                              const ImageSize& window) noexcept {
  return exchanges_sides(output_steps) ? ImageSize{window.height_px, window.width_px} : window;
}

/// Returns the place in a window's picture that a place of the mirrored and rotated picture shows.
/// With w and h for the size of the window, a rotation takes (x, y) to (x, y) for 0 degrees,
/// (y, h - x) for 90, (w - x, h - y) for 180 and (w - y, x) for 270. A mirror then takes x to
/// w - x, or y to h - y. The other steps play no part. RT-safe.
[[nodiscard]] constexpr ImagePoint window_point(std::uint16_t output_steps, const ImageSize& window,
                                                const ImagePoint& turned) noexcept {
  const double w = window.width_px;
  const double h = window.height_px;
  ImagePoint out = turned;
  if ((output_steps & kOutputRotated180) != 0) {
    // The picture before this half turn has the size of the picture after it.
    const ImageSize size = turned_size(output_steps, window);
    out = {size.width_px - out.x_px, size.height_px - out.y_px};
  }
  if ((output_steps & kOutputRotated90) != 0) out = {out.y_px, h - out.x_px};
  if ((output_steps & kOutputMirroredHorizontally) != 0) out.x_px = w - out.x_px;
  if ((output_steps & kOutputMirroredVertically) != 0) out.y_px = h - out.y_px;
  return out;
}

}  // namespace emit::protocol
