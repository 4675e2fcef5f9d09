// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"

/// Reports as HTML pages that need nothing but themselves. Setup only; any thread.
namespace emit::tool {

/// Returns text for HTML, with the characters & < > " replaced.
[[nodiscard]] std::string html_escaped(std::string_view text);

/// Returns a page around a body. `style` follows the common rules of CSS.
[[nodiscard]] std::string html_page(std::string_view title, std::string_view style,
                                    std::string_view body);

/// Writes a page; an older file is replaced when the new one is complete. Errors: io.
[[nodiscard]] physics::Result<void> write_html(const std::filesystem::path& file,
                                               const std::string& page);

}  // namespace emit::tool
