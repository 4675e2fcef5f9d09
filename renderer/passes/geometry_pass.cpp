// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "draw/image_window.hpp"
#include "emit/physics/check.hpp"
#include "passes/render_target.hpp"

namespace emit::renderer {
namespace {

/// Number of indices after which commands are flushed on a software rasteriser. Mesa sorts
/// triangles into screen tiles on the caller's thread, and its other threads fill the tiles
/// meanwhile, but only with commands that were flushed.
constexpr std::int32_t kSoftwareBatchIndices = 12'000;

/// GLSL type and texture of one value by band.
struct BandsType {
  const char* glsl;
  const char* swizzle;  ///< of a vec4
  GLenum format;
};

/// Issues one multi-draw per record.
void issue_at_once(std::span<const ViewDraw> draws, const ViewRanges& ranges,
                   const gl::Buffer& records) noexcept {
  for (const ViewDraw& draw : draws) {
    records.bind_uniform(EMIT_BIND_DRAW, draw.record * sizeof(DrawRecord), sizeof(gpu::DrawParams));
    glMultiDrawElementsBaseVertex(GL_TRIANGLES, ranges.index_count.data() + draw.first,
                                  GL_UNSIGNED_INT, ranges.index_offset.data() + draw.first,
                                  static_cast<GLsizei>(draw.count),
                                  ranges.base_vertex.data() + draw.first);
  }
}

/// Issues the draws in pieces and flushes after every kSoftwareBatchIndices indices.
void issue_in_batches(std::span<const ViewDraw> draws, const ViewRanges& ranges,
                      const gl::Buffer& records) noexcept {
  std::int32_t room = kSoftwareBatchIndices;
  for (const ViewDraw& draw : draws) {
    records.bind_uniform(EMIT_BIND_DRAW, draw.record * sizeof(DrawRecord), sizeof(gpu::DrawParams));
    for (std::uint32_t range = draw.first; range < draw.first + draw.count; ++range) {
      const auto* next = static_cast<const std::uint32_t*>(ranges.index_offset[range]);
      for (std::int32_t left = ranges.index_count[range]; left > 0;) {
        const std::int32_t count = std::min(left, room);
        glDrawElementsBaseVertex(GL_TRIANGLES, count, GL_UNSIGNED_INT, next,
                                 ranges.base_vertex[range]);
        next += count;
        left -= count;
        room -= count;
        if (room > 0) continue;
        glFlush();
        room = kSoftwareBatchIndices;
      }
    }
  }
}

}  // namespace

physics::Result<GeometryPass> GeometryPass::create(const gl::EglContext& context,
                                                   const Setup& setup) {
  EMIT_CHECK_OP(setup.bands, >=, 1U);
  EMIT_CHECK_OP(setup.bands, <=, std::uint32_t{EMIT_MAX_BANDS});
  GeometryPass pass;
  pass.software_ = context.software();
  pass.threads_ = context.threads();
  // Compile the program for the content.
  std::vector<gl::Define> defines;
  const bool sampled = setup.content != Content::normals;
  const bool objects = setup.content == Content::samples_and_objects;
  if (sampled) {
    // A texture has one, two or four components.
    constexpr std::array<BandsType, EMIT_MAX_BANDS> kTypes{{{"float", "x", GL_R32F},
                                                            {"vec2", "xy", GL_RG32F},
                                                            {"vec4", "xyzw", GL_RGBA32F},
                                                            {"vec4", "xyzw", GL_RGBA32F}}};
    const BandsType& type = kTypes[setup.bands - 1];
    defines.push_back({"EMIT_CACHED", "1"});
    defines.push_back({"EMIT_BANDS", fmt::format("{}u", setup.bands)});
    defines.push_back({"EMIT_BANDS_VEC", type.glsl});
    defines.push_back({"EMIT_BANDS_OF(v)", fmt::format("(v).{}", type.swizzle)});
    pass.incoming_ = gl::Texture(type.format, static_cast<GLsizei>(setup.width_px),
                                 static_cast<GLsizei>(setup.height_px));
    if (setup.seen) defines.push_back({"EMIT_SEEN", "1"});
  }
  if (objects) defines.push_back({"EMIT_OBJECTS", "1"});
  if (setup.clutter) defines.push_back({"EMIT_CLUTTER", "1"});
  const bool normals = sampled && setup.normal;
  if (normals) {
    const int place = 2 + (objects ? 1 : 0) + (setup.clutter ? 1 : 0);
    defines.push_back({"EMIT_NORMAL", fmt::format("{}", place)});
  }
  if (setup.shade == Shade::of_entities) defines.push_back({"EMIT_SHADE", "1"});
  auto program = gl::Program::graphics("passes/geometry.vert", "passes/geometry.frag", defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  // Make the textures of the content and attach them.
  const auto width = static_cast<GLsizei>(setup.width_px);
  const auto height = static_cast<GLsizei>(setup.height_px);
  pass.sampled_ = sampled;
  pass.depth_buffer_ = gl::Texture(GL_DEPTH_COMPONENT32F, width, height);
  pass.framebuffer_ = gl::Framebuffer::make();
  const GLuint id = pass.framebuffer_.id();
  glNamedFramebufferTexture(id, GL_DEPTH_ATTACHMENT, pass.depth_buffer_.id(), 0);
  if (sampled) {
    pass.surface_ = gl::Texture(GL_RG32UI, width, height);
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT0, pass.surface_.id(), 0);
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT1, pass.incoming_.id(), 0);
    if (objects) {
      pass.ids_ = gl::Texture(GL_R16UI, width, height);
      glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT2, pass.ids_.id(), 0);
    }
    GLsizei count = objects ? 3 : 2;
    constexpr std::array<GLenum, 5> kTargets{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1,
                                             GL_COLOR_ATTACHMENT2, GL_COLOR_ATTACHMENT3,
                                             GL_COLOR_ATTACHMENT4};
    if (setup.clutter) {
      pass.clutter_ = gl::Texture(GL_RGBA32UI, width, height);
      glNamedFramebufferTexture(id, kTargets[static_cast<std::size_t>(count)], pass.clutter_.id(),
                                0);
      ++count;
    }
    if (normals) {
      pass.normal_ = gl::Texture(GL_RG16_SNORM, width, height);
      glNamedFramebufferTexture(id, kTargets[static_cast<std::size_t>(count)], pass.normal_.id(),
                                0);
      ++count;
    }
    glNamedFramebufferDrawBuffers(id, count, kTargets.data());
  } else {
    pass.depth_m_ = gl::Texture(GL_R32F, width, height);
    pass.normal_ = gl::Texture(GL_RG16_SNORM, width, height);
    pass.ids_ = gl::Texture(GL_RG16UI, width, height);
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT0, pass.depth_m_.id(), 0);
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT1, pass.normal_.id(), 0);
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT2, pass.ids_.id(), 0);
    const GLenum targets[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1, GL_COLOR_ATTACHMENT2};
    glNamedFramebufferDrawBuffers(id, 3, targets);
  }
  if (auto ok = check_complete(pass.framebuffer_, "geometry buffer"); !ok) {
    return tl::unexpected(std::move(ok.error()));
  }
  return pass;
}

void GeometryPass::clear(const View& view) const noexcept {
  // Restrict drawing to the window. Pixels that are not drawn need not be cleared.
  const glm::uvec2 image_px = window_size_px(view.image_px);
  glViewport(static_cast<GLint>(view.image_px.x), static_cast<GLint>(view.image_px.y),
             static_cast<GLsizei>(image_px.x), static_cast<GLsizei>(image_px.y));
  const glm::uvec2 part_px = window_size_px(view.window_px);
  glScissor(static_cast<GLint>(view.window_px.x), static_cast<GLint>(view.window_px.y),
            static_cast<GLsizei>(part_px.x), static_cast<GLsizei>(part_px.y));
  // Clear to sky. Depth is reversed: 0 is infinitely far away.
  const GLfloat far_away = 0.0F;
  if (!sampled_) {
    const GLfloat sky[4] = {EMIT_SKY_DEPTH_M, 0.0F, 0.0F, 0.0F};
    const GLfloat zero[4] = {0.0F, 0.0F, 0.0F, 0.0F};
    const GLuint none[4] = {0, 0, 0, 0};
    glClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 0, sky);
    glClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 1, zero);
    glClearNamedFramebufferuiv(framebuffer_.id(), GL_COLOR, 2, none);
  }
  glClearNamedFramebufferfv(framebuffer_.id(), GL_DEPTH, 0, &far_away);
}

void GeometryPass::draw(const SceneVertexArrays& vertices, const DrawLists& lists,
                        const gl::Buffer& records, std::span<const View> views) const noexcept {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glEnable(GL_SCISSOR_TEST);
  // Front faces turn clockwise, because row 0 of the image is at the bottom of GL's window and the
  // view is mirrored.
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glFrontFace(GL_CW);
  glCullFace(GL_BACK);
  program_.use();
  vertices.bind_view();
  threads_.leave_core_to_caller();
  const auto draw_all = software_ ? issue_in_batches : issue_at_once;
  for (const View& view : views) {
    clear(view);
    // Draw single-sided submeshes with culling, then double-sided ones without.
    glEnable(GL_CULL_FACE);
    draw_all(lists.view_draws(view.single_sided), lists.view_ranges(), records);
    glDisable(GL_CULL_FACE);
    draw_all(lists.view_draws(view.double_sided), lists.view_ranges(), records);
  }
  if (software_) glFlush();
  threads_.spread();
  glDisable(GL_SCISSOR_TEST);
}

void GeometryPass::bind_textures() const noexcept {
  if (sampled_) {
    depth_buffer_.bind(EMIT_TEX_DEPTH);
    surface_.bind(EMIT_TEX_SURFACE);
    incoming_.bind(EMIT_TEX_INCOMING);
    glBindImageTexture(EMIT_IMG_SURFACE, surface_.id(), 0, GL_FALSE, 0, GL_READ_WRITE, GL_RG32UI);
    if (ids_.id() != 0) ids_.bind(EMIT_TEX_IDS);
    if (normal_.id() != 0) normal_.bind(EMIT_TEX_NORMAL);
    if (clutter_.id() != 0) clutter_.bind(EMIT_TEX_CLUTTER_PIXELS);
    return;
  }
  depth_m_.bind(EMIT_TEX_DEPTH);
  normal_.bind(EMIT_TEX_NORMAL);
  ids_.bind(EMIT_TEX_IDS);
}

}  // namespace emit::renderer
