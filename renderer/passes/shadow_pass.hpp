// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "draw/draw_lists.hpp"
#include "emit/physics/error.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "passes/scene_vertex_arrays.hpp"
#include "shared/bindings.glsl.h"

namespace emit::renderer {

/// Shadow maps (part 3 of the paper): depth seen from the sun, one layer per light frustum, drawn
/// anew for every interval of the history. See passes/shadow.vert. Thread: the one that owns the GL
/// context. Real time: create() is setup only, the rest is RT-safe.
class ShadowPass {
 public:
  /// Compiles the pass and makes `layers` maps of `size_px` x `size_px` texels. Errors: gpu (names
  /// the shader or the render target).
  /// @pre size_px >= 1, layers is 1..EMIT_MAX_CASCADES.
  [[nodiscard]] static physics::Result<ShadowPass> create(std::uint32_t size_px,
                                                          std::uint32_t layers);
  /// Clears the layer of a light frustum and draws the commands into it.
  /// @pre cascade < layers
  void draw(const SceneVertexArrays& vertices, std::uint32_t cascade,
            std::span<const LightCommand> commands) const noexcept;
  /// Binds the maps to the texture unit EMIT_TEX_SHADOW.
  void bind_texture() const noexcept;

 private:
  gl::Program program_;
  gl::Texture maps_;
  std::array<gl::Framebuffer, EMIT_MAX_CASCADES> framebuffers_;
  std::uint32_t layers_ = 0;
  GLsizei size_px_ = 0;
};

}  // namespace emit::renderer
