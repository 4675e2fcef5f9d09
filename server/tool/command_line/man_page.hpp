// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "tool/command_line/command_description.hpp"

namespace emit::tool {

/// Heading of a manual page.
struct ManHeading {
  std::string title;    ///< name of the page, e.g. "emit-render"
  std::string command;  ///< what is typed, e.g. "emit render"
  int section = 1;
  std::string version;                ///< e.g. "emit 0.2.0"
  std::vector<std::string> see_also;  ///< other pages with their section, e.g. "emit(1)"
};

/// Manual page of one command in the language of man(7). It says what --help says.
[[nodiscard]] std::string man_page(const CommandDescription& command, const ManHeading& heading);

/// A manual page and the file that man(1) looks it up in.
struct ManFile {
  std::string name;  ///< e.g. "emit-render.1"
  std::string text;
};

/// Pages of section 1 for the program and for all commands below it.
[[nodiscard]] std::vector<ManFile> man_pages(const CommandDescription& program,
                                             const std::string& version);

}  // namespace emit::tool
