// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>

#include "emit/physics/error.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"

namespace emit::renderer {

/// Enlargement of a rendered image with fewer pixels to the size of the output image. See
/// passes/enlarge.comp.
/// Thread: the one that owns the GL context. Real time: create() is setup only, the rest is
/// RT-safe.
class EnlargePass {
 public:
  /// Compiles the pass and allocates `planes` planes of `rendered_px` pixels. The first `bands`
  /// planes hold radiance. Errors: gpu (names the shader).
  /// @pre 1 <= bands <= planes, rendered_px >= 1
  [[nodiscard]] static physics::Result<EnlargePass> create(std::uint32_t bands,
                                                           std::uint32_t planes,
                                                           std::size_t rendered_px);
  /// Buffer of the planes that the passes before this one write.
  [[nodiscard]] const gl::Buffer& planes() const noexcept { return planes_; }
  /// Writes the window of the output image, which has `size_px` pixels, to EMIT_BIND_OUTPUT.
  void dispatch(const glm::uvec2& size_px) const noexcept;

 private:
  gl::Program program_;
  gl::Buffer planes_;
  gl::BufferTexture view_;  ///< planes_ as a texture
};

}  // namespace emit::renderer
