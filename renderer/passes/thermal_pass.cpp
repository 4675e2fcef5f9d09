// SPDX-License-Identifier: Apache-2.0
#include "passes/thermal_pass.hpp"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "passes/pixel_groups.hpp"
#include "shared/bindings.glsl.h"

namespace emit::renderer {

physics::Result<ThermalPass> ThermalPass::create(std::uint32_t width_px, std::uint32_t height_px,
                                                 const scene::ThermalOptions& options,
                                                 std::uint32_t foster_groups) {
  ThermalPass pass;
  // Compile the step of the thermal model.
  std::vector<gl::Define> defines = {
      {"EMIT_BLOCKER_TAPS", fmt::format("{}u", options.blocker_taps)},
      {"EMIT_FILTER_TAPS", fmt::format("{}u", options.filter_taps)},
      {"EMIT_FOSTER_GROUPS", fmt::format("{}", foster_groups)}};
  const bool foster = options.model == scene::ThermalModel::foster;
  auto step_program =
      gl::Program::compute(foster ? "passes/thermal_foster.comp" : "passes/thermal.comp", defines);
  if (!step_program) return tl::unexpected(std::move(step_program.error()));
  // Compile the program that stores the sun alone, which both models share.
  defines.push_back({"EMIT_SUN_ONLY", "1"});
  auto sun_program = gl::Program::compute("passes/thermal.comp", defines);
  if (!sun_program) return tl::unexpected(std::move(sun_program.error()));
  pass.step_program_ = std::move(*step_program);
  pass.sun_program_ = std::move(*sun_program);
  if (foster) pass.state_format_ = GL_RGBA32F;
  pass.state_ =
      image_texture(pass.state_format_, width_px, foster ? height_px * foster_groups : height_px);
  pass.sun_now_ = image_texture(GL_R32F, width_px, height_px);
  return pass;
}

void ThermalPass::dispatch(const gl::Program& program, const glm::uvec2& size_px) const noexcept {
  program.use();
  glBindImageTexture(EMIT_IMG_STATE, state_.id(), 0, GL_FALSE, 0, GL_READ_WRITE, state_format_);
  glBindImageTexture(EMIT_IMG_SUN_NOW, sun_now_.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
  dispatch_pixels(size_px);
  glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
}

void ThermalPass::dispatch_step(const glm::uvec2& size_px) const noexcept {
  dispatch(step_program_, size_px);
}

void ThermalPass::dispatch_sun_only(const glm::uvec2& size_px) const noexcept {
  dispatch(sun_program_, size_px);
}

void ThermalPass::bind_textures() const noexcept {
  state_.bind(EMIT_TEX_STATE);
  sun_now_.bind(EMIT_TEX_SUN_NOW);
}

}  // namespace emit::renderer
