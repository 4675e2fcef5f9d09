// SPDX-License-Identifier: Apache-2.0
#include "console/console_files.hpp"

#include <algorithm>

namespace emit::server {

const ConsoleFile* find_console_file(std::string_view target) noexcept {
  if (!target.starts_with('/')) {
    return nullptr;
  }
  const std::string_view name = target == "/" ? "index.html" : target.substr(1);
  const auto files = console_files();
  const auto found = std::ranges::find(files, name, &ConsoleFile::name);
  return found == files.end() ? nullptr : &*found;
}

std::string_view media_type(std::string_view name) noexcept {
  if (name.ends_with(".html")) return "text/html; charset=utf-8";
  if (name.ends_with(".js")) return "text/javascript; charset=utf-8";
  if (name.ends_with(".css")) return "text/css; charset=utf-8";
  if (name.ends_with(".svg")) return "image/svg+xml";
  return "application/octet-stream";
}

}  // namespace emit::server
