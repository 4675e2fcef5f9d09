// SPDX-License-Identifier: Apache-2.0
#include "passes/scene_vertex_arrays.hpp"

#include <cstdint>

namespace emit::renderer {
namespace {

/// Vertex buffer binding of the light records.
constexpr GLuint kRecordBinding = 2;

/// Lets a vertex array read one record per instance.
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

}  // namespace

SceneVertexArrays::SceneVertexArrays(const SceneBuffers& scene, const gl::Buffer& light_records)
    : view_(gl::VertexArray::make()), light_(gl::VertexArray::make()) {
  // Read indices and positions in both vertex arrays.
  for (const GLuint id : {view_.id(), light_.id()}) {
    glVertexArrayElementBuffer(id, scene.indices());
    glVertexArrayVertexBuffer(id, 0, scene.positions(), 0, 3 * sizeof(float));
    glVertexArrayAttribFormat(id, EMIT_ATTR_POSITION, 3, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(id, EMIT_ATTR_POSITION, 0);
    glEnableVertexArrayAttrib(id, EMIT_ATTR_POSITION);
  }
  // Read normals for the camera and records for the light.
  const GLuint view = view_.id();
  glVertexArrayVertexBuffer(view, 1, scene.normals(), 0, 4 * sizeof(std::int16_t));
  glVertexArrayAttribFormat(view, EMIT_ATTR_NORMAL, 4, GL_SHORT, GL_TRUE, 0);
  glVertexArrayAttribBinding(view, EMIT_ATTR_NORMAL, 1);
  glEnableVertexArrayAttrib(view, EMIT_ATTR_NORMAL);
  read_records(light_.id(), light_records);
  // Read the openings of hulls where there are entities.
  if (scene.hulls() == 0) return;
  constexpr GLuint kHullBinding = 6;
  glVertexArrayVertexBuffer(view, kHullBinding, scene.hulls(), 0, 4 * sizeof(std::int16_t));
  glVertexArrayAttribFormat(view, EMIT_ATTR_HULL, 4, GL_SHORT, GL_TRUE, 0);
  glVertexArrayAttribBinding(view, EMIT_ATTR_HULL, kHullBinding);
  glEnableVertexArrayAttrib(view, EMIT_ATTR_HULL);
}

void SceneVertexArrays::read_nodes(const gl::Buffer& before,
                                   const gl::Buffer& after) const noexcept {
  const auto read = [this](GLuint attribute, GLuint binding, const gl::Buffer& node) {
    glVertexArrayVertexBuffer(view_.id(), binding, node.id(), 0, kNodeFloats * sizeof(float));
    glVertexArrayAttribFormat(view_.id(), attribute, kNodeFloats, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(view_.id(), attribute, binding);
    glEnableVertexArrayAttrib(view_.id(), attribute);
  };
  read(EMIT_ATTR_NODE_BEFORE, 3, before);
  read(EMIT_ATTR_NODE_AFTER, 4, after);
}

void SceneVertexArrays::read_twins(const gl::Buffer& before, const gl::Buffer& after,
                                   std::size_t drawn) const noexcept {
  const auto read = [this](GLuint attribute, GLuint binding, const gl::Buffer& node,
                           std::size_t first, GLint components) {
    glVertexArrayVertexBuffer(view_.id(), binding, node.id(),
                              static_cast<GLintptr>(first * kNodeFloats * sizeof(float)),
                              kNodeFloats * sizeof(float));
    glVertexArrayAttribFormat(view_.id(), attribute, components, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(view_.id(), attribute, binding);
    glEnableVertexArrayAttrib(view_.id(), attribute);
  };
  read(EMIT_ATTR_LOW_BEFORE, 9, before, drawn, 1);
  read(EMIT_ATTR_LOW_AFTER, 10, after, drawn, 2);
  read(EMIT_ATTR_HIGH_BEFORE, 11, before, 2 * drawn, 1);
  read(EMIT_ATTR_HIGH_AFTER, 12, after, 2 * drawn, 2);
}

void SceneVertexArrays::read_seen(const gl::Buffer& before, const gl::Buffer& after,
                                  std::uint32_t bands) const noexcept {
  const auto read = [&](GLuint attribute, GLuint binding, const gl::Buffer& node) {
    glVertexArrayVertexBuffer(view_.id(), binding, node.id(), 0,
                              static_cast<GLsizei>(bands * sizeof(float)));
    glVertexArrayAttribFormat(view_.id(), attribute, static_cast<GLint>(bands), GL_FLOAT, GL_FALSE,
                              0);
    glVertexArrayAttribBinding(view_.id(), attribute, binding);
    glEnableVertexArrayAttrib(view_.id(), attribute);
  };
  read(EMIT_ATTR_SEEN_BEFORE, 7, before);
  read(EMIT_ATTR_SEEN_AFTER, 8, after);
}

void SceneVertexArrays::read_shade(const gl::Buffer& shade) const noexcept {
  constexpr GLuint kBinding = 5;
  glVertexArrayVertexBuffer(view_.id(), kBinding, shade.id(), 0, sizeof(float));
  glVertexArrayAttribFormat(view_.id(), EMIT_ATTR_SHADE, 1, GL_FLOAT, GL_FALSE, 0);
  glVertexArrayAttribBinding(view_.id(), EMIT_ATTR_SHADE, kBinding);
  glEnableVertexArrayAttrib(view_.id(), EMIT_ATTR_SHADE);
}

}  // namespace emit::renderer
