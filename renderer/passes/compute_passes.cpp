// SPDX-License-Identifier: Apache-2.0
#include "passes/compute_passes.hpp"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "shared/bindings.glsl.h"

namespace emit::renderer {
namespace {

/// Of a picture, that a group of EnlargePass does.
constexpr glm::uvec2 kEnlargePx(64, 16);

void dispatch_pixels(const glm::uvec2& size_px, std::uint32_t rows = 1) noexcept {
  glDispatchCompute((size_px.x + 7) / 8, (size_px.y + 8 * rows - 1) / (8 * rows), 1);
}

gl::Texture make_texture(GLenum format, std::uint32_t width_px, std::uint32_t height_px) {
  return gl::Texture(format, static_cast<GLsizei>(width_px), static_cast<GLsizei>(height_px));
}

}  // namespace

gl::Define rows_define(std::uint32_t rows) {
  return {"EMIT_ROWS", fmt::format("{}u", rows)};
}

physics::Result<OcclusionPass> OcclusionPass::create(std::uint32_t width_px,
                                                     std::uint32_t height_px) {
  OcclusionPass pass;
  auto program = gl::Program::compute("passes/occlusion.comp");
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  pass.sky_frac_ = make_texture(GL_R32F, width_px, height_px);
  return pass;
}

void OcclusionPass::dispatch(const glm::uvec2& size_px) const noexcept {
  program_.use();
  glBindImageTexture(EMIT_IMG_OCCLUSION, sky_frac_.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
  dispatch_pixels(size_px);
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

void OcclusionPass::bind_texture() const noexcept {
  sky_frac_.bind(EMIT_TEX_OCCLUSION);
}

physics::Result<ThermalPass> ThermalPass::create(std::uint32_t width_px, std::uint32_t height_px,
                                                 const scene::ThermalOptions& options) {
  ThermalPass pass;
  std::vector<gl::Define> defines = {
      {"EMIT_BLOCKER_TAPS", fmt::format("{}u", options.blocker_taps)},
      {"EMIT_FILTER_TAPS", fmt::format("{}u", options.filter_taps)}};
  const bool foster = options.model == scene::ThermalModel::foster;
  auto step_program =
      gl::Program::compute(foster ? "passes/thermal_foster.comp" : "passes/thermal.comp", defines);
  if (!step_program) return tl::unexpected(std::move(step_program.error()));
  defines.push_back({"EMIT_SUN_ONLY", "1"});
  auto sun_program = gl::Program::compute("passes/thermal.comp", defines);
  if (!sun_program) return tl::unexpected(std::move(sun_program.error()));
  pass.step_program_ = std::move(*step_program);
  pass.sun_program_ = std::move(*sun_program);
  if (foster) pass.state_format_ = GL_RGBA32F;
  pass.state_ = make_texture(pass.state_format_, width_px, height_px);
  pass.sun_now_ = make_texture(GL_R32F, width_px, height_px);
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

physics::Result<RadiancePass> RadiancePass::create(const scene::ThermalOptions& options,
                                                   const RadianceContent& content, bool software) {
  RadiancePass pass;
  pass.rows_ = pixel_rows(software);
  std::vector<gl::Define> defines{{"EMIT_BANDS", fmt::format("{}u", content.bands)},
                                  {"EMIT_AIR_TERMS", fmt::format("{}u", content.air_terms)},
                                  {"EMIT_AIR_TABLE", fmt::format("{}u", content.air_table)},
                                  {"EMIT_TERMS", fmt::format("{}", content.terms)},
                                  {"EMIT_OUTPUTS", fmt::format("{}u", content.outputs)},
                                  rows_define(pass.rows_)};
  if (options.model == scene::ThermalModel::foster) defines.push_back({"EMIT_FOSTER", "1"});
  if (options.method == scene::ThermalMethod::cached) defines.push_back({"EMIT_CACHED", "1"});
  auto program = gl::Program::compute("passes/radiance.comp", defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  return pass;
}

void RadiancePass::dispatch(const glm::uvec2& size_px) const noexcept {
  program_.use();
  dispatch_pixels(size_px, rows_);
}

physics::Result<EnlargePass> EnlargePass::create(std::uint32_t bands, std::uint32_t planes,
                                                 std::size_t rendered_px) {
  EnlargePass pass;
  const std::vector<gl::Define> defines{{"EMIT_BANDS", fmt::format("{}u", bands)},
                                        {"EMIT_PLANES", fmt::format("{}u", planes)},
                                        {"EMIT_ENLARGE_WIDTH", std::to_string(kEnlargePx.x)},
                                        {"EMIT_ENLARGE_HEIGHT", std::to_string(kEnlargePx.y)}};
  auto program = gl::Program::compute("passes/enlarge.comp", defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  pass.planes_ = gl::Buffer(planes * rendered_px * sizeof(float), nullptr, 0);
  pass.view_ = gl::BufferTexture(GL_R32F, pass.planes_);
  return pass;
}

void EnlargePass::dispatch(const glm::uvec2& size_px) const noexcept {
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
  program_.use();
  view_.bind(EMIT_TEX_SCALED);
  const glm::uvec2 groups = (size_px + kEnlargePx - 1U) / kEnlargePx;
  glDispatchCompute(groups.x, groups.y, 1);
}

}  // namespace emit::renderer
