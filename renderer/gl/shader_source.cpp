// SPDX-License-Identifier: Apache-2.0
#include "gl/shader_source.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "emit/physics/constants.hpp"

namespace emit::gl {
namespace {

using physics::ErrorCode;
using physics::make_error;

std::string_view find_embedded(std::string_view path) {
  for (const EmbeddedShader& shader : embedded_shaders()) {
    if (shader.path == path) return shader.text;
  }
  return {};
}

physics::Result<void> append_file(std::string_view path, ShaderSource& out) {
  if (std::find(out.files.begin(), out.files.end(), path) != out.files.end()) return {};
  const std::string_view text = find_embedded(path);
  if (text.empty()) {
    return make_error(ErrorCode::not_found, fmt::format("shader '{}' is not embedded", path));
  }
  const std::size_t file_number = out.files.size();
  out.files.emplace_back(path);
  out.text += fmt::format("#line 1 {}\n", file_number);

  std::size_t line_number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    std::size_t end = text.find('\n', begin);
    if (end == std::string_view::npos) end = text.size();
    const std::string_view line = text.substr(begin, end - begin);
    begin = end + 1;
    ++line_number;
    constexpr std::string_view kInclude = "#include \"";
    if (line.substr(0, kInclude.size()) == kInclude) {
      const std::size_t close = line.find('"', kInclude.size());
      const std::string_view included = line.substr(kInclude.size(), close - kInclude.size());
      if (auto result = append_file(included, out); !result) {
        return make_error(result.error().code,
                          fmt::format("{}:{}: {}", path, line_number, result.error().text));
      }
      out.text += fmt::format("#line {} {}\n", line_number + 1, file_number);
    } else {
      out.text.append(line);
      out.text += '\n';
    }
  }
  return {};
}

}  // namespace

physics::Result<ShaderSource> load_shader(std::string_view path, std::span<const Define> defines) {
  ShaderSource source;
  source.text = "#version 450 core\n";
  const auto constant = [&source](std::string_view name, double value) {
    source.text += fmt::format("#define {} {:#.9g}\n", name, value);
  };
  constant("EMIT_PI", physics::kPi);
  constant("EMIT_STEFAN_BOLTZMANN_W_M2_K4", physics::kStefanBoltzmannWPerM2K4);
  constant("EMIT_C2_UM_K", physics::kC2UmK);
  constant("EMIT_RADIANCE_C1_W_UM4_M2_SR", physics::kRadianceC1WUm4PerM2Sr);
  constant("EMIT_SUN_SEMI_ANGLE_RAD", physics::kSunSemiAngleRad);
  for (const Define& define : defines) {
    source.text += fmt::format("#define {} {}\n", define.name, define.value);
  }
  if (auto result = append_file(path, source); !result) {
    return tl::unexpected(std::move(result.error()));
  }
  return source;
}

}  // namespace emit::gl
