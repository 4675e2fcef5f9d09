// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::verify {

/// A CSV table in memory: comma separated, header row, LF or CRLF, lines starting with '#' and
/// blank lines ignored, no quoting. Cells are parsed only where a column is asked for.
class CsvTable {
 public:
  /// Errors: not_found, io; parse naming file and line (cell count, double or empty column name,
  /// no header).
  [[nodiscard]] static physics::Result<CsvTable> read(const std::filesystem::path& file);
  /// The same from text; `name` stands for the file in messages.
  [[nodiscard]] static physics::Result<CsvTable> parse(std::string text, std::string name);

  [[nodiscard]] std::size_t rows() const noexcept { return lines_.size(); }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Line of a row in the file, from 1, for messages.
  [[nodiscard]] std::size_t line_of(std::size_t row) const { return lines_[row]; }

  /// Errors: invalid_argument naming the missing column; parse naming file, line and column of a
  /// cell that is not a number (`nan` and `inf` are).
  [[nodiscard]] physics::Result<std::vector<double>> numbers(std::string_view column) const;
  [[nodiscard]] physics::Result<std::vector<std::string_view>> texts(std::string_view column) const;

 private:
  [[nodiscard]] physics::Result<std::size_t> find(std::string_view column) const;
  [[nodiscard]] std::string_view cell(std::size_t row, std::size_t column) const;

  std::string name_;
  std::string text_;  // cells are offsets into it, so that a moved table stays valid
  struct Cell {
    std::size_t begin = 0;
    std::size_t length = 0;
  };
  std::vector<std::string> columns_;
  std::vector<Cell> cells_;  // row-major
  std::vector<std::size_t> lines_;
};

}  // namespace emit::verify
