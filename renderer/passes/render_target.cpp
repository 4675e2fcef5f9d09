// SPDX-License-Identifier: Apache-2.0
#include "passes/render_target.hpp"

#include <string>

namespace emit::renderer {

physics::Result<void> check_complete(const gl::Framebuffer& framebuffer, const char* name) {
  if (glCheckNamedFramebufferStatus(framebuffer.id(), GL_DRAW_FRAMEBUFFER) ==
      GL_FRAMEBUFFER_COMPLETE) {
    return {};
  }
  return physics::make_error(physics::ErrorCode::gpu,
                             std::string(name) + ": the driver refuses the render target");
}

}  // namespace emit::renderer
