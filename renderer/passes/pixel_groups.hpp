// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>

#include "gl/objects.hpp"
#include "gl/program.hpp"

/// Work groups of the full-screen compute passes. A work group computes one or more blocks of 8 x 8
/// pixels. The renderer binds the storage blocks; each pass binds the textures and images it owns.
/// FrameParams says where the window of the frame begins, and the call of a pass says how large it
/// is.
namespace emit::renderer {

/// Blocks of 8 x 8 pixels, one below the other, that one work group computes. On a CPU (`software`)
/// starting a group and fetching its uniforms take as long as some of its pixels.
[[nodiscard]] constexpr std::uint32_t pixel_rows(bool software) noexcept {
  return software ? 8 : 1;
}
/// Definition EMIT_ROWS, the number of blocks that a work group computes.
[[nodiscard]] gl::Define rows_define(std::uint32_t rows);

/// Dispatches the current program over `size_px` pixels, with `rows` blocks per work group.
/// RT-safe.
/// @pre rows >= 1
void dispatch_pixels(const glm::uvec2& size_px, std::uint32_t rows = 1) noexcept;

/// Texture of one level for an image. Setup only.
[[nodiscard]] gl::Texture image_texture(GLenum format, std::uint32_t width_px,
                                        std::uint32_t height_px);

}  // namespace emit::renderer
