// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/physics/error.hpp"

namespace emit::verify {

/// CSV table in memory: comma separated, with a header row, LF or CRLF, without quoting. Blank
/// lines and lines that begin with '#' are ignored. Cells are parsed only in columns that a caller
/// requests.
class CsvTable {
 public:
  /// Reads a file. Errors: not_found; io; parse names file and line (number of cells, repeated or
  /// empty column name, no header).
  [[nodiscard]] static physics::Result<CsvTable> read(const std::filesystem::path& file);
  /// Reads a table from text. `name` replaces the file in messages. Errors: parse.
  [[nodiscard]] static physics::Result<CsvTable> parse(std::string text, std::string name);

  [[nodiscard]] std::size_t rows() const noexcept { return lines_.size(); }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Returns the line of a row in the file, from 1, for messages.
  /// @pre row < rows()
  [[nodiscard]] std::size_t line_of(std::size_t row) const {
    EMIT_CHECK_OP(row, <, rows());
    return lines_[row];
  }

  /// Returns the numbers of a column. Errors: invalid_argument names the missing column; parse
  /// names file, line and column of a cell that is not a number (`nan` and `inf` are numbers).
  [[nodiscard]] physics::Result<std::vector<double>> numbers(std::string_view column) const;
  /// Returns the texts of a column, which point into the table. Errors: invalid_argument names the
  /// missing column.
  [[nodiscard]] physics::Result<std::vector<std::string_view>> texts(std::string_view column) const;

 private:
  [[nodiscard]] physics::Result<std::size_t> find(std::string_view column) const;
  [[nodiscard]] std::string_view cell(std::size_t row, std::size_t column) const;

  std::string name_;
  std::string text_;  // cells are offsets into the text, so that a moved table stays valid
  struct Cell {
    std::size_t begin = 0;
    std::size_t length = 0;
  };
  std::vector<std::string> columns_;
  std::vector<Cell> cells_;  // row-major
  std::vector<std::size_t> lines_;
};

}  // namespace emit::verify
