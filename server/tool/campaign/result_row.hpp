// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// Results of one element of a campaign: names of columns and texts of cells, in order. Numbers
/// have as many digits as their type keeps.
class ResultRow {
 public:
  void set(const std::string& column, std::string text);
  void set(const std::string& column, double value);
  /// Returns a cell; empty if the row has no such column.
  [[nodiscard]] std::string text(const std::string& column) const;
  /// Returns the number of a cell; NaN where there is none.
  [[nodiscard]] double number(const std::string& column) const;
  [[nodiscard]] const std::vector<std::pair<std::string, std::string>>& cells() const noexcept {
    return cells_;
  }

 private:
  std::vector<std::pair<std::string, std::string>> cells_;
};

/// File of one row, with the identity of the run that made it. Errors: io.
[[nodiscard]] physics::Result<void> write_result_row(const std::filesystem::path& file,
                                                     const std::string& identity,
                                                     const ResultRow& row);
/// Reads such a file. Empty: it does not exist, is not complete, or has another identity.
[[nodiscard]] std::optional<ResultRow> read_result_row(const std::filesystem::path& file,
                                                       const std::string& identity);

/// Returns rows as one CSV table. It has the columns of all rows, in the order in which they first
/// come; cells that a row does not have are empty.
[[nodiscard]] std::string result_table(const std::vector<ResultRow>& rows);

}  // namespace emit::tool
