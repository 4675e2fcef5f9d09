// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// The one reader of CSV files: weather, poses, trajectories, responses, atmospheres, and the
/// tables of `emit evaluate` and `emit fit`.
///
/// The format is RFC 4180 in UTF-8: a header row, then one row per record; cells may be quoted,
/// with doubled quotes inside; lines end with LF, CR LF or CR; a byte order mark is skipped. Blanks
/// around a cell do not count. Beyond the RFC, lines that begin with '#' are comments, and rows
/// without any content are ignored, as are empty cells behind the last named column.
///
/// Other dialects give one error that says what is the matter: UTF-16, binary files, cells
/// separated by anything but commas, indented comments, a header row that holds numbers.
namespace emit::physics {

struct CsvCell {
  std::string text;          ///< without quotes and without blanks at either end
  std::uint32_t line = 1;    ///< where the cell begins, from 1
  std::uint32_t column = 1;  ///< likewise, in characters from 1
  bool quoted = false;
};

/// Reads row by row. Memory: one row. Thread: one owner.
class CsvReader {
 public:
  /// Reads the header row. Errors: not_found; io; parse as above. Errors name the file.
  [[nodiscard]] static Result<CsvReader> open(const std::filesystem::path& file);
  /// Reads the header row of text in memory; `name` stands for the file in messages.
  [[nodiscard]] static Result<CsvReader> from_text(std::string text, std::string name);
  CsvReader(CsvReader&&) noexcept;
  CsvReader& operator=(CsvReader&&) noexcept;
  ~CsvReader();

  [[nodiscard]] const std::string& name() const noexcept;
  [[nodiscard]] std::span<const CsvCell> header() const noexcept;
  /// Position of the column of that name. Errors: parse, when the header has none or two.
  [[nodiscard]] Result<std::size_t> find(std::string_view column) const;

  /// Moves to the next row; false at the end. Errors (parse, io) name file, line and column. A row
  /// with another number of cells than the header is an error.
  [[nodiscard]] Result<bool> next();
  /// The cells of the row, as many as header(). They live until the next call of next().
  [[nodiscard]] std::span<const CsvCell> row() const noexcept;
  /// Line where the row begins; before the first row, that of the header.
  [[nodiscard]] std::uint32_t line() const noexcept;
  /// "file:line:column" of a cell, for messages.
  [[nodiscard]] std::string place_of(const CsvCell& cell) const;

 private:
  struct Impl;
  explicit CsvReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// A whole CSV file in memory. Cells are read as numbers only where a column is asked for.
class CsvTable {
 public:
  /// Errors: those of CsvReader.
  [[nodiscard]] static Result<CsvTable> read(const std::filesystem::path& file);
  /// Reads a table from text in memory; `name` stands for the file in messages.
  [[nodiscard]] static Result<CsvTable> parse(std::string text, std::string name);

  [[nodiscard]] std::size_t rows() const noexcept { return lines_.size(); }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Line of a row in the file, from 1, for messages.
  /// @pre row < rows()
  [[nodiscard]] std::size_t line_of(std::size_t row) const;

  /// True if the header names the column.
  [[nodiscard]] bool has(std::string_view column) const noexcept;
  /// Reads a column of numbers. Errors: invalid_argument, when the column is missing; parse, when
  /// it exists twice, or when a cell is not a number (`nan` and `inf` are numbers here). The second
  /// kind names file, line and column.
  [[nodiscard]] Result<std::vector<double>> numbers(std::string_view column) const;
  /// Reads a column of texts. The views live as long as the table. Errors: those of a column, as
  /// above.
  [[nodiscard]] Result<std::vector<std::string_view>> texts(std::string_view column) const;

 private:
  struct Place {
    std::size_t begin = 0;
    std::size_t length = 0;
  };
  [[nodiscard]] static Result<CsvTable> read_all(Result<CsvReader> reader);
  [[nodiscard]] Result<std::size_t> find(std::string_view column) const;
  [[nodiscard]] std::string_view cell(std::size_t row, std::size_t column) const;

  std::string name_;
  std::string text_;  // the cells one behind the other, so that a moved table stays valid
  std::vector<std::string> columns_;
  std::uint32_t header_line_ = 1;
  std::vector<Place> cells_;  // row-major
  std::vector<std::size_t> lines_;
};

/// Returns the number that a cell holds: a decimal number with '.', a leading '+' allowed, `nan` or
/// `inf`. The result is empty when the cell holds something else. Thread: any.
[[nodiscard]] std::optional<double> csv_number(std::string_view text) noexcept;
/// Returns the reason why `text` is not a number, for messages: "which is not a number", with a
/// hint for decimal commas and for dates.
[[nodiscard]] std::string not_a_number_text(std::string_view text);
/// Returns a hint for a time in seconds beyond the range of simulation times: "; this looks like
/// UNIX time ...", or an empty text.
[[nodiscard]] std::string unix_time_hint(double seconds);

}  // namespace emit::physics
