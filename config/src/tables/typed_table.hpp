// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "keys/key.hpp"

/// CSV files whose columns have names, ranges and units known to the key table.
namespace emit::config {

struct TableColumn {
  std::string name;
  bool required = true;
  Range range;
  bool text = false;  ///< the cell is taken as text and not read as a number
};

struct TableRow {
  std::uint32_t line = 0;
  std::vector<std::optional<double>> numbers;  ///< by position in the list of columns; empty: none
  std::vector<std::string> texts;              ///< likewise
};

/// Reads a table and checks every value against its column's range. Columns may stand in any order.
/// Errors: those of physics::CsvReader; config with one line per faulty column, which names the
/// first place ("file:line:column: text") and counts the other rows.
[[nodiscard]] physics::Result<std::vector<TableRow>> read_typed_table(
    const std::filesystem::path& file, const std::vector<TableColumn>& columns);

}  // namespace emit::config
