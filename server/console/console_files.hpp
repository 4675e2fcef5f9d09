// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string_view>

namespace emit::server {

/// A file of the page, compiled into the program.
struct ConsoleFile {
  std::string_view name;  ///< "console.js"
  std::string_view text;
};
/// Returns the files of the page; the build makes them of web/.
[[nodiscard]] std::span<const ConsoleFile> console_files() noexcept;

/// Returns the file that a request names, "/" being index.html; null: there is none.
[[nodiscard]] const ConsoleFile* find_console_file(std::string_view target) noexcept;
/// Returns the media type of a file by the end of its name.
[[nodiscard]] std::string_view media_type(std::string_view name) noexcept;

}  // namespace emit::server
