// SPDX-License-Identifier: Apache-2.0
#include "passes/raster_passes.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "draw/picture_window.hpp"

namespace emit::renderer {
namespace {

/// Mesa sorts triangles into tiles on the caller's thread; others fill these meanwhile, but only
/// with what was flushed.
constexpr std::int32_t kSoftwareBatchIndices = 12'000;

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

/// The same, flushed every so often.
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

void issue(std::span<const LightCommand> commands) noexcept {
  for (const LightCommand& command : commands) {
    const auto offset = static_cast<std::uintptr_t>(command.range.first_index) * 4U;
    glDrawElementsInstancedBaseVertexBaseInstance(
        GL_TRIANGLES, static_cast<GLsizei>(command.range.index_count), GL_UNSIGNED_INT,
        reinterpret_cast<const void*>(offset), static_cast<GLsizei>(command.count),
        command.base_vertex, command.first_record);
  }
}

constexpr GLuint kRecordBinding = 2;

/// One record per instance.
void read_records(GLuint array, const gl::Buffer& records) {
  glVertexArrayVertexBuffer(array, kRecordBinding, records.id(), 0, sizeof(LightRecord));
  for (GLuint row = 0; row < 3; ++row) {
    const GLuint attribute = EMIT_ATTR_ROW + row;
    glVertexArrayAttribFormat(array, attribute, 4, GL_FLOAT, GL_FALSE, row * 4 * sizeof(float));
    glVertexArrayAttribBinding(array, attribute, kRecordBinding);
    glEnableVertexArrayAttrib(array, attribute);
  }
  glVertexArrayBindingDivisor(array, kRecordBinding, 1);
}

physics::Result<void> check_complete(const gl::Framebuffer& framebuffer, const char* name) {
  if (glCheckNamedFramebufferStatus(framebuffer.id(), GL_DRAW_FRAMEBUFFER) ==
      GL_FRAMEBUFFER_COMPLETE) {
    return {};
  }
  return physics::make_error(physics::ErrorCode::gpu,
                             std::string(name) + ": the driver refuses the render target");
}

}  // namespace

SceneVertexArrays::SceneVertexArrays(const SceneBuffers& scene, const gl::Buffer& light_records)
    : view_(gl::VertexArray::make()), light_(gl::VertexArray::make()) {
  for (const GLuint id : {view_.id(), light_.id()}) {
    glVertexArrayElementBuffer(id, scene.indices());
    glVertexArrayVertexBuffer(id, 0, scene.positions(), 0, 3 * sizeof(float));
    glVertexArrayAttribFormat(id, EMIT_ATTR_POSITION, 3, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(id, EMIT_ATTR_POSITION, 0);
    glEnableVertexArrayAttrib(id, EMIT_ATTR_POSITION);
  }
  const GLuint view = view_.id();
  glVertexArrayVertexBuffer(view, 1, scene.normals(), 0, 4 * sizeof(std::int16_t));
  glVertexArrayAttribFormat(view, EMIT_ATTR_NORMAL, 4, GL_SHORT, GL_TRUE, 0);
  glVertexArrayAttribBinding(view, EMIT_ATTR_NORMAL, 1);
  glEnableVertexArrayAttrib(view, EMIT_ATTR_NORMAL);
  read_records(light_.id(), light_records);
}

void SceneVertexArrays::read_nodes(const gl::Buffer& before,
                                   const gl::Buffer& after) const noexcept {
  const auto read = [this](GLuint attribute, GLuint binding, const gl::Buffer& node) {
    glVertexArrayVertexBuffer(view_.id(), binding, node.id(), 0, 2 * sizeof(float));
    glVertexArrayAttribFormat(view_.id(), attribute, 2, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(view_.id(), attribute, binding);
    glEnableVertexArrayAttrib(view_.id(), attribute);
  };
  read(EMIT_ATTR_NODE_BEFORE, 3, before);
  read(EMIT_ATTR_NODE_AFTER, 4, after);
}

void SceneVertexArrays::read_shade(const gl::Buffer& shade) const noexcept {
  constexpr GLuint kBinding = 5;
  glVertexArrayVertexBuffer(view_.id(), kBinding, shade.id(), 0, sizeof(float));
  glVertexArrayAttribFormat(view_.id(), EMIT_ATTR_SHADE, 1, GL_FLOAT, GL_FALSE, 0);
  glVertexArrayAttribBinding(view_.id(), EMIT_ATTR_SHADE, kBinding);
  glEnableVertexArrayAttrib(view_.id(), EMIT_ATTR_SHADE);
}

physics::Result<GeometryPass> GeometryPass::create(const gl::EglContext& context,
                                                   std::uint32_t width_px, std::uint32_t height_px,
                                                   Content content, Shade shade) {
  GeometryPass pass;
  pass.software_ = context.software();
  pass.threads_ = context.threads();
  std::vector<gl::Define> defines;
  const bool sampled = content != Content::normals;
  const bool objects = content == Content::samples_and_objects;
  if (sampled) defines.push_back({"EMIT_CACHED", "1"});
  if (objects) defines.push_back({"EMIT_OBJECTS", "1"});
  if (shade == Shade::of_entities) defines.push_back({"EMIT_SHADE", "1"});
  auto program = gl::Program::graphics("passes/geometry.vert", "passes/geometry.frag", defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  const auto width = static_cast<GLsizei>(width_px);
  const auto height = static_cast<GLsizei>(height_px);
  pass.sampled_ = sampled;
  pass.depth_buffer_ = gl::Texture(GL_DEPTH_COMPONENT32F, width, height);
  pass.framebuffer_ = gl::Framebuffer::make();
  const GLuint id = pass.framebuffer_.id();
  glNamedFramebufferTexture(id, GL_DEPTH_ATTACHMENT, pass.depth_buffer_.id(), 0);
  if (sampled) {
    pass.surface_ = gl::Texture(GL_RG32UI, width, height);
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT0, pass.surface_.id(), 0);
    if (objects) {
      pass.ids_ = gl::Texture(GL_R16UI, width, height);
      glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT1, pass.ids_.id(), 0);
    }
    const GLenum targets[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    glNamedFramebufferDrawBuffers(id, objects ? 2 : 1, targets);
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

void GeometryPass::draw(const SceneVertexArrays& vertices, const DrawLists& lists,
                        const gl::Buffer& records, CommandRange single_sided,
                        CommandRange double_sided, const glm::uvec2& size_px,
                        const glm::uvec4& window_px) const noexcept {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glViewport(0, 0, static_cast<GLsizei>(size_px.x), static_cast<GLsizei>(size_px.y));
  const glm::uvec2 part_px = window_size_px(window_px);
  glScissor(static_cast<GLint>(window_px.x), static_cast<GLint>(window_px.y),
            static_cast<GLsizei>(part_px.x), static_cast<GLsizei>(part_px.y));
  glEnable(GL_SCISSOR_TEST);      // what is not drawn need not be cleared
  const GLfloat far_away = 0.0F;  // reversed z
  if (!sampled_) {
    const GLfloat sky[4] = {EMIT_SKY_DEPTH_M, 0.0F, 0.0F, 0.0F};
    const GLfloat zero[4] = {0.0F, 0.0F, 0.0F, 0.0F};
    const GLuint none[4] = {0, 0, 0, 0};
    glClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 0, sky);
    glClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 1, zero);
    glClearNamedFramebufferuiv(framebuffer_.id(), GL_COLOR, 2, none);
  }
  glClearNamedFramebufferfv(framebuffer_.id(), GL_DEPTH, 0, &far_away);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glFrontFace(GL_CW);  // image row 0 is at the bottom of GL's window: the view is mirrored
  glCullFace(GL_BACK);
  program_.use();
  vertices.bind_view();
  glEnable(GL_CULL_FACE);
  threads_.leave_core_to_caller();
  const auto draw_all = software_ ? issue_in_batches : issue_at_once;
  draw_all(lists.view_draws(single_sided), lists.view_ranges(), records);
  glDisable(GL_CULL_FACE);
  draw_all(lists.view_draws(double_sided), lists.view_ranges(), records);
  if (software_) glFlush();
  threads_.spread();
  glDisable(GL_SCISSOR_TEST);
}

void GeometryPass::bind_textures() const noexcept {
  if (sampled_) {
    depth_buffer_.bind(EMIT_TEX_DEPTH);
    surface_.bind(EMIT_TEX_SURFACE);
    glBindImageTexture(EMIT_IMG_SURFACE, surface_.id(), 0, GL_FALSE, 0, GL_READ_WRITE, GL_RG32UI);
    if (ids_.id() != 0) ids_.bind(EMIT_TEX_IDS);
    return;
  }
  depth_m_.bind(EMIT_TEX_DEPTH);
  normal_.bind(EMIT_TEX_NORMAL);
  ids_.bind(EMIT_TEX_IDS);
}

physics::Result<ShadowPass> ShadowPass::create(std::uint32_t size_px, std::uint32_t layers) {
  ShadowPass pass;
  auto program = gl::Program::graphics("passes/shadow.vert", "");
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  pass.size_px_ = static_cast<GLsizei>(size_px);
  pass.maps_ = gl::Texture(GL_DEPTH_COMPONENT32F, pass.size_px_, pass.size_px_,
                           static_cast<GLsizei>(layers));
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
  const gl::Framebuffer& framebuffer = framebuffers_[cascade];
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glViewport(0, 0, size_px_, size_px_);
  const GLfloat far_away = 1.0F;
  glClearNamedFramebufferfv(framebuffer.id(), GL_DEPTH, 0, &far_away);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glFrontFace(GL_CW);  // row 0 of the map is at the bottom of GL's window as well
  glCullFace(GL_BACK);
  program_.use();
  vertices.bind_light();
  // The face of a closed body that is nearest to the sun looks at the sun: half of its triangles
  // need no setup and no rasterisation. Sheets cast shadow with either side.
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
