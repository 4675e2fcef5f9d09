// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>

#include "emit/physics/error.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"

namespace emit::renderer {

/// Obscurance of every visible point (part 2 of the paper): the share of a ball around it that lies
/// in front of the depth buffer. See passes/occlusion.comp. Thread: the one that owns the GL
/// context. Real time: create() is setup only, the rest is RT-safe.
class OcclusionPass {
 public:
  /// Compiles the pass for images of up to `width_px` x `height_px`. Errors: gpu (names the
  /// shader).
  [[nodiscard]] static physics::Result<OcclusionPass> create(std::uint32_t width_px,
                                                             std::uint32_t height_px);
  /// Computes the window of the frame, which has `size_px` pixels.
  void dispatch(const glm::uvec2& size_px) const noexcept;
  /// Binds the result to the texture unit EMIT_TEX_OCCLUSION.
  void bind_texture() const noexcept;

 private:
  gl::Program program_;
  gl::Texture open_frac_;  ///< R32F: open share of the ball, 0..1
};

}  // namespace emit::renderer
