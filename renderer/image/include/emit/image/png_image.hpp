// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::image {

/// Colour as sRGB bytes: red, green, blue.
using Rgb = std::array<std::uint8_t, 3>;

/// 8-bit sRGB image, row-major, rows down, three bytes a pixel.
struct RgbImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<std::uint8_t> rgb;
};

/// Writes an image as a PNG file. It allocates and writes files, so frame threads must not call it.
/// Errors: invalid_argument (size and data disagree; a side is 0 or above 32768), io (naming the
/// file).
[[nodiscard]] physics::Result<void> write_png(const std::filesystem::path& file,
                                              const RgbImage& image);

}  // namespace emit::image
