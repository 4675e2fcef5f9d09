// SPDX-License-Identifier: Apache-2.0
#include "passes/pixel_groups.hpp"

#include <fmt/format.h>

#include "emit/physics/check.hpp"

namespace emit::renderer {

gl::Define rows_define(std::uint32_t rows) {
  return {"EMIT_ROWS", fmt::format("{}u", rows)};
}

void dispatch_pixels(const glm::uvec2& size_px, std::uint32_t rows) noexcept {
  EMIT_CHECK_OP(rows, >=, 1U);
  glDispatchCompute((size_px.x + 7) / 8, (size_px.y + 8 * rows - 1) / (8 * rows), 1);
}

gl::Texture image_texture(GLenum format, std::uint32_t width_px, std::uint32_t height_px) {
  return gl::Texture(format, static_cast<GLsizei>(width_px), static_cast<GLsizei>(height_px));
}

}  // namespace emit::renderer
