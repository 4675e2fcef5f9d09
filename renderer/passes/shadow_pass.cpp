// SPDX-License-Identifier: Apache-2.0
#include "passes/shadow_pass.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "emit/physics/check.hpp"
#include "passes/render_target.hpp"

namespace emit::renderer {
namespace {

/// Issues instanced draws.
void issue(std::span<const LightCommand> commands) noexcept {
  for (const LightCommand& command : commands) {
    const auto offset = static_cast<std::uintptr_t>(command.range.first_index) * 4U;
    glDrawElementsInstancedBaseVertexBaseInstance(
        GL_TRIANGLES, static_cast<GLsizei>(command.range.index_count), GL_UNSIGNED_INT,
        reinterpret_cast<const void*>(offset), static_cast<GLsizei>(command.count),
        command.base_vertex, command.first_record);
  }
}

}  // namespace

physics::Result<ShadowPass> ShadowPass::create(std::uint32_t size_px, std::uint32_t layers) {
  EMIT_CHECK_OP(size_px, >=, 1U);
  EMIT_CHECK_OP(layers, >=, 1U);
  EMIT_CHECK_OP(layers, <=, std::uint32_t{EMIT_MAX_CASCADES});
  ShadowPass pass;
  pass.layers_ = layers;
  auto program = gl::Program::graphics("passes/shadow.vert", "");
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  pass.size_px_ = static_cast<GLsizei>(size_px);
  pass.maps_ = gl::Texture(GL_DEPTH_COMPONENT32F, pass.size_px_, pass.size_px_,
                           static_cast<GLsizei>(layers));
  // Give each layer a framebuffer of its own.
  for (std::uint32_t i = 0; i < layers; ++i) {
    pass.framebuffers_[i] = gl::Framebuffer::make();
    const GLuint id = pass.framebuffers_[i].id();
    glNamedFramebufferTextureLayer(id, GL_DEPTH_ATTACHMENT, pass.maps_.id(), 0,
                                   static_cast<GLint>(i));
    glNamedFramebufferDrawBuffer(id, GL_NONE);
    if (auto ok = check_complete(pass.framebuffers_[i], "shadow map"); !ok) {
      return tl::unexpected(std::move(ok.error()));
    }
  }
  return pass;
}

void ShadowPass::draw(const SceneVertexArrays& vertices, std::uint32_t cascade,
                      std::span<const LightCommand> commands) const noexcept {
  EMIT_CHECK_OP(cascade, <, layers_);
  const gl::Framebuffer& framebuffer = framebuffers_[cascade];
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glViewport(0, 0, size_px_, size_px_);
  const GLfloat far_away = 1.0F;
  glClearNamedFramebufferfv(framebuffer.id(), GL_DEPTH, 0, &far_away);
  // Front faces turn clockwise, because row 0 of the map is at the bottom of GL's window.
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glFrontFace(GL_CW);
  glCullFace(GL_BACK);
  program_.use();
  vertices.bind_light();
  // Draw runs of commands that need the same culling. The face of a closed mesh that is nearest to
  // the sun faces the sun, so half of its triangles need no rasterisation. Sheets cast shadows with
  // both sides.
  while (!commands.empty()) {
    const bool both_sides = commands.front().range.double_sided;
    const auto end = std::ranges::find_if(commands, [both_sides](const LightCommand& command) {
      return command.range.double_sided != both_sides;
    });
    const auto count = static_cast<std::size_t>(end - commands.begin());
    if (both_sides) {
      glDisable(GL_CULL_FACE);
    } else {
      glEnable(GL_CULL_FACE);
    }
    issue(commands.first(count));
    commands = commands.subspan(count);
  }
}

void ShadowPass::bind_texture() const noexcept {
  maps_.bind(EMIT_TEX_SHADOW);
}

}  // namespace emit::renderer
