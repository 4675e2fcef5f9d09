// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"

namespace emit::renderer {

/// Thermal steps of every visible point (part 4 of the paper). See passes/thermal.comp and
/// passes/thermal_foster.comp.
/// Thread: the one that owns the GL context. Real time: create() is setup only, the rest is
/// RT-safe.
class ThermalPass {
 public:
  /// Compiles the pass for images of up to `width_px` x `height_px` and for the thermal model and
  /// the numbers of taps in `options`. `foster_groups` is the number of texels that hold the modes
  /// of a pixel with foster, 1 or 2. Errors: gpu (names the shader).
  [[nodiscard]] static physics::Result<ThermalPass> create(std::uint32_t width_px,
                                                           std::uint32_t height_px,
                                                           const scene::ThermalOptions& options,
                                                           std::uint32_t foster_groups);
  /// Advances every visible point over the interval that is bound as EMIT_BIND_STEP. The window of
  /// the frame has `size_px` pixels.
  void dispatch_step(const glm::uvec2& size_px) const noexcept;
  /// Stores the visible share of the sun in that interval, for reflected sunlight, and changes no
  /// temperature.
  void dispatch_sun_only(const glm::uvec2& size_px) const noexcept;
  /// Binds the results to the texture units EMIT_TEX_STATE and EMIT_TEX_SUN_NOW.
  void bind_textures() const noexcept;

 private:
  void dispatch(const gl::Program& program, const glm::uvec2& size_px) const noexcept;

  gl::Program step_program_;
  gl::Program sun_program_;
  /// Temperature offsets of two modes, K. With foster of four, and those of all further modes lie
  /// in as many rows below.
  gl::Texture state_;
  GLenum state_format_ = GL_RG32F;
  gl::Texture sun_now_;  ///< R32F: visible share of the sun's disc at the instant of the frame
};

}  // namespace emit::renderer
