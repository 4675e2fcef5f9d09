// SPDX-License-Identifier: Apache-2.0
#include "passes/enlarge_pass.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "emit/physics/check.hpp"
#include "shared/bindings.glsl.h"

namespace emit::renderer {
namespace {

/// Pixels of the output image that one work group writes.
constexpr glm::uvec2 kGroupPx(64, 16);

}  // namespace

physics::Result<EnlargePass> EnlargePass::create(std::uint32_t bands, std::uint32_t planes,
                                                 std::size_t rendered_px) {
  EMIT_CHECK_OP(bands, >=, 1U);
  EMIT_CHECK_OP(bands, <=, planes);
  EMIT_CHECK_OP(rendered_px, >=, std::size_t{1});
  EnlargePass pass;
  const std::vector<gl::Define> defines{{"EMIT_BANDS", fmt::format("{}u", bands)},
                                        {"EMIT_PLANES", fmt::format("{}u", planes)},
                                        {"EMIT_ENLARGE_WIDTH", std::to_string(kGroupPx.x)},
                                        {"EMIT_ENLARGE_HEIGHT", std::to_string(kGroupPx.y)}};
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
  const glm::uvec2 groups = (size_px + kGroupPx - 1U) / kGroupPx;
  glDispatchCompute(groups.x, groups.y, 1);
}

}  // namespace emit::renderer
