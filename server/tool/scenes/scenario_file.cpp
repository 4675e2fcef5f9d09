// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/scenario_file.hpp"

#include <fmt/format.h>

#include <system_error>

#include "tool/support/replacing_file.hpp"

namespace emit::tool {

using physics::Result;

std::string toml_quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      out += fmt::format("\\u{:04x}", static_cast<unsigned int>(c));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

Result<void> write_text_file(const std::filesystem::path& path, const std::string& text) {
  auto file = ReplacingFile::create(path);
  if (!file) return tl::unexpected(std::move(file.error()));
  if (auto done = file->write(text); !done) return done;
  return file->commit();
}

Result<void> check_new_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return {};
  return physics::make_error(
      physics::ErrorCode::io,
      fmt::format("{}: exists already, and is not written over", path.string()));
}

}  // namespace emit::tool
