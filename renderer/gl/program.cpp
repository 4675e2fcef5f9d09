// SPDX-License-Identifier: Apache-2.0
#include "gl/program.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>

namespace emit::gl {
namespace {

using physics::ErrorCode;
using physics::make_error;

physics::Result<GLuint> compile(GLenum stage, std::string_view path,
                                std::span<const Define> defines) {
  auto source = load_shader(path, defines);
  if (!source) return tl::unexpected(std::move(source.error()));
  const GLuint shader = glCreateShader(stage);
  const char* text = source->text.c_str();
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint ok = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok == GL_TRUE) return shader;

  std::string log(8192, '\0');
  GLsizei length = 0;
  glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), &length, log.data());
  log.resize(static_cast<std::size_t>(length));
  glDeleteShader(shader);
  std::string files;
  for (std::size_t i = 0; i < source->files.size(); ++i) {
    files += fmt::format(" {}={}", i, source->files[i]);
  }
  return make_error(ErrorCode::gpu, fmt::format("shader '{}' (files:{}): {}", path, files, log));
}

physics::Result<GLuint> link(std::span<const GLuint> shaders, std::string_view name) {
  const GLuint program = glCreateProgram();
  for (const GLuint shader : shaders) glAttachShader(program, shader);
  glLinkProgram(program);
  for (const GLuint shader : shaders) {
    glDetachShader(program, shader);
    glDeleteShader(shader);
  }
  GLint ok = GL_FALSE;
  glGetProgramiv(program, GL_LINK_STATUS, &ok);
  if (ok == GL_TRUE) return program;
  std::string log(8192, '\0');
  GLsizei length = 0;
  glGetProgramInfoLog(program, static_cast<GLsizei>(log.size()), &length, log.data());
  log.resize(static_cast<std::size_t>(length));
  glDeleteProgram(program);
  return make_error(ErrorCode::gpu, fmt::format("linking '{}': {}", name, log));
}

}  // namespace

Program::~Program() {
  if (id_ != 0) glDeleteProgram(id_);
}
Program::Program(Program&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
Program& Program::operator=(Program&& other) noexcept {
  std::swap(id_, other.id_);
  return *this;
}

physics::Result<Program> Program::compute(std::string_view path, std::span<const Define> defines) {
  auto shader = compile(GL_COMPUTE_SHADER, path, defines);
  if (!shader) return tl::unexpected(std::move(shader.error()));
  const GLuint shaders[] = {*shader};
  auto program = link(shaders, path);
  if (!program) return tl::unexpected(std::move(program.error()));
  return Program(*program);
}

physics::Result<Program> Program::graphics(std::string_view vertex_path,
                                           std::string_view fragment_path,
                                           std::span<const Define> defines) {
  auto vertex = compile(GL_VERTEX_SHADER, vertex_path, defines);
  if (!vertex) return tl::unexpected(std::move(vertex.error()));
  GLuint shaders[2] = {*vertex, 0};
  std::size_t count = 1;
  if (!fragment_path.empty()) {
    auto fragment = compile(GL_FRAGMENT_SHADER, fragment_path, defines);
    if (!fragment) {
      glDeleteShader(*vertex);
      return tl::unexpected(std::move(fragment.error()));
    }
    shaders[count++] = *fragment;
  }
  auto program = link(std::span(shaders, count), vertex_path);
  if (!program) return tl::unexpected(std::move(program.error()));
  return Program(*program);
}

GLint Program::uniform_offset(const char* name) const noexcept {
  const GLuint index = glGetProgramResourceIndex(id_, GL_UNIFORM, name);
  if (index == GL_INVALID_INDEX) return -1;
  const GLenum property = GL_OFFSET;
  GLint offset = -1;
  glGetProgramResourceiv(id_, GL_UNIFORM, index, 1, &property, 1, nullptr, &offset);
  return offset;
}

}  // namespace emit::gl
