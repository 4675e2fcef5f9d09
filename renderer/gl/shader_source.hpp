// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::gl {

/// Shader file compiled into the binary: path relative to renderer/shaders, and its text.
struct EmbeddedShader {
  std::string_view path;
  std::string_view text;
};
[[nodiscard]] std::span<const EmbeddedShader> embedded_shaders();

struct Define {
  std::string name;
  std::string value;
};

/// Full source of an embedded shader: version line, physical constants from physics/constants.hpp,
/// `defines`, then the file with every `#include "path"` expanded once. #line directives number the
/// files in the order of `files`, so that a driver's message can be traced.
struct ShaderSource {
  std::string text;
  std::vector<std::string> files;
};
[[nodiscard]] physics::Result<ShaderSource> load_shader(std::string_view path,
                                                        std::span<const Define> defines);

}  // namespace emit::gl
