// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "keys/key.hpp"

namespace emit::config {

struct CsvColumn {
  std::string name;
  bool required = true;
  Range range;
  bool text = false;  ///< taken as it stands
};

struct CsvRow {
  std::uint32_t line = 0;
  std::vector<std::optional<double>> numbers;  ///< by column of the specification; empty: no value
  std::vector<std::string> texts;
};

/// Header row, LF or CRLF, `#` lines and blank lines ignored, columns in any order, no quoting.
/// Every value is checked against its column's range. Errors: not_found; io; config with
/// "file:line:column: text" (columns count characters).
[[nodiscard]] physics::Result<std::vector<CsvRow>> read_csv(const std::filesystem::path& file,
                                                            const std::vector<CsvColumn>& columns);

}  // namespace emit::config
