// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <epoxy/gl.h>

#include <span>
#include <string_view>

#include "emit/physics/error.hpp"
#include "gl/shader_source.hpp"

namespace emit::gl {

/// A linked GL program. Owner: one pass. Thread: the one with the context. Build: setup only.
class Program {
 public:
  Program() = default;
  ~Program();
  Program(Program&& other) noexcept;
  Program& operator=(Program&& other) noexcept;
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Errors (gpu): the driver's message with file names put back in.
  [[nodiscard]] static physics::Result<Program> compute(std::string_view path,
                                                        std::span<const Define> defines = {});
  /// An empty `fragment_path` links a depth-only program.
  [[nodiscard]] static physics::Result<Program> graphics(std::string_view vertex_path,
                                                         std::string_view fragment_path,
                                                         std::span<const Define> defines = {});

  void use() const noexcept { glUseProgram(id_); }
  [[nodiscard]] GLuint id() const noexcept { return id_; }
  /// Byte offset that the driver gave a member of a uniform block, -1 if it is not in use.
  [[nodiscard]] GLint uniform_offset(const char* name) const noexcept;

 private:
  explicit Program(GLuint id) noexcept : id_(id) {}
  GLuint id_ = 0;
};

}  // namespace emit::gl
