// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::gl {

/// Shader file that is compiled into the binary: its path relative to renderer/shaders, and its
/// text.
struct EmbeddedShader {
  std::string_view path;
  std::string_view text;
};
/// Returns all embedded shader files. Thread: any.
[[nodiscard]] std::span<const EmbeddedShader> embedded_shaders();

/// Preprocessor definition.
struct Define {
  std::string name;
  std::string value;
};

/// Full source of an embedded shader: the version line, the physical constants of
/// physics/constants.hpp, the definitions, then the file with every `#include "path"` expanded
/// once. #line directives number the files in the order of `files`, so that a driver's message can
/// be traced.
struct ShaderSource {
  std::string text;
  std::vector<std::string> files;
};
/// Builds the source of an embedded shader. Errors (not_found): the file or an included one is not
/// embedded; the text names file and line. Thread: any. It allocates.
[[nodiscard]] physics::Result<ShaderSource> load_shader(std::string_view path,
                                                        std::span<const Define> defines);

}  // namespace emit::gl
