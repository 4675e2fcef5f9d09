// SPDX-License-Identifier: Apache-2.0
#include "tool/support/console.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace emit::tool {

int fail(int code, std::string_view text) {
  fmt::print(stderr, "emit: error: {}\n", text);
  return code;
}

int fail(const physics::Error& error) {
  return fail(error.code == physics::ErrorCode::config ? kExitConfig : kExitFailure, error.text);
}

int fail_call(const physics::Error& error) {
  return error.code == physics::ErrorCode::invalid_argument ? fail(kExitUsage, error.text)
                                                            : fail(error);
}

int fail_config(const physics::Error& error) {
  return fail(kExitConfig, error.text);
}

void warn(std::string_view text) {
  fmt::print(stderr, "emit: warning: {}\n", text);
}

std::FILE* text_stream(const std::optional<std::filesystem::path>& json) {
  return json && *json == "-" ? stderr : stdout;
}

std::string TextTable::to_string() const {
  std::vector<std::size_t> widths;
  for (const auto& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string out;
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i == 0) {
        out += fmt::format("{:<{}}", row[i], widths[i]);
      } else {
        out += fmt::format("  {:>{}}", row[i], widths[i]);
      }
    }
    out += '\n';
  }
  return out;
}

}  // namespace emit::tool
