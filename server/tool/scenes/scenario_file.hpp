// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// Returns a text in the spelling of TOML.
[[nodiscard]] std::string toml_quoted(const std::string& text);

/// Writes a text file, which takes the place of an existing one when it is complete. Errors: io.
[[nodiscard]] physics::Result<void> write_text_file(const std::filesystem::path& path,
                                                    const std::string& text);

/// Checks that no file of the name exists, since somebody may have worked on it. Errors: io.
[[nodiscard]] physics::Result<void> check_new_file(const std::filesystem::path& path);

}  // namespace emit::tool
