// SPDX-License-Identifier: Apache-2.0
#include "passes/occlusion_pass.hpp"

#include <utility>

#include "passes/pixel_groups.hpp"
#include "shared/bindings.glsl.h"

namespace emit::renderer {

physics::Result<OcclusionPass> OcclusionPass::create(std::uint32_t width_px,
                                                     std::uint32_t height_px) {
  OcclusionPass pass;
  auto program = gl::Program::compute("passes/occlusion.comp");
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  pass.open_frac_ = image_texture(GL_R32F, width_px, height_px);
  return pass;
}

void OcclusionPass::dispatch(const glm::uvec2& size_px) const noexcept {
  program_.use();
  glBindImageTexture(EMIT_IMG_OCCLUSION, open_frac_.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
  dispatch_pixels(size_px);
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

void OcclusionPass::bind_texture() const noexcept {
  open_frac_.bind(EMIT_TEX_OCCLUSION);
}

}  // namespace emit::renderer
