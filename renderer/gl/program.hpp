// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <epoxy/gl.h>

#include <span>
#include <string_view>

#include "emit/physics/error.hpp"
#include "gl/shader_source.hpp"

namespace emit::gl {

/// Linked GL program. Owner: one pass.
/// Thread: the one with the context.  Real time: building is setup only.
class Program {
 public:
  Program() = default;
  ~Program();
  Program(Program&& other) noexcept;
  Program& operator=(Program&& other) noexcept;
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Builds a compute program from an embedded shader. Errors: gpu (the driver's message, with a
  /// table of its file numbers); not_found (a shader that is not embedded).
  [[nodiscard]] static physics::Result<Program> compute(std::string_view path,
                                                        std::span<const Define> defines = {});
  /// Builds a program for drawing. An empty `fragment_path` gives a depth-only program. Errors as
  /// for compute().
  [[nodiscard]] static physics::Result<Program> graphics(std::string_view vertex_path,
                                                         std::string_view fragment_path,
                                                         std::span<const Define> defines = {});

  void use() const noexcept { glUseProgram(id_); }
  [[nodiscard]] GLuint id() const noexcept { return id_; }
  /// Returns the byte offset that the driver gave a member of a uniform block, or -1 when the
  /// member is not in use.
  [[nodiscard]] GLint uniform_offset(const char* name) const noexcept;

 private:
  explicit Program(GLuint id) noexcept : id_(id) {}
  GLuint id_ = 0;
};

}  // namespace emit::gl
