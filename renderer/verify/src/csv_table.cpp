// SPDX-License-Identifier: Apache-2.0
#include "csv_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r';
}

/// Removes the blanks at both ends of [begin, end).
void trim(std::string_view text, std::size_t& begin, std::size_t& end) {
  while (begin < end && is_blank(text[begin])) ++begin;
  while (end > begin && is_blank(text[end - 1])) --end;
}

/// Returns the number that the text consists of, or nothing.
std::optional<double> parse_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size() || text.empty()) return std::nullopt;
  if (error == std::errc()) return value;
  if (error != std::errc::result_out_of_range) return std::nullopt;
  // 1e-400 gives 0 and 1e400 gives infinity, as everywhere in IEEE arithmetic.
  return std::strtod(std::string(text).c_str(), nullptr);
}

}  // namespace

Result<CsvTable> CsvTable::read(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    return make_error(ErrorCode::not_found, fmt::format("no table '{}'", file.string()));
  }
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream.is_open() || stream.bad() || std::filesystem::is_directory(file, error)) {
    return make_error(ErrorCode::io, fmt::format("cannot read '{}'", file.string()));
  }
  return parse(std::move(text).str(), file.string());
}

Result<CsvTable> CsvTable::parse(std::string text, std::string name) {
  CsvTable table;
  table.name_ = std::move(name);
  table.text_ = std::move(text);
  const std::string_view all = table.text_;
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  std::size_t at = all.substr(0, 3) == kByteOrderMark ? 3 : 0;

  std::size_t line = 0;
  while (at < all.size()) {
    const std::size_t newline = std::min(all.find('\n', at), all.size());
    std::size_t begin = at;
    std::size_t end = newline;
    at = newline + 1;
    ++line;
    trim(all, begin, end);
    if (begin == end || all[begin] == '#') continue;

    std::vector<Cell> cells;
    for (std::size_t cell_begin = begin;;) {
      const std::size_t comma = std::min(all.find(',', cell_begin), end);
      std::size_t b = cell_begin;
      std::size_t e = comma;
      trim(all, b, e);
      cells.push_back({b, e - b});
      if (comma == end) break;
      cell_begin = comma + 1;
    }

    if (table.columns_.empty()) {
      for (const Cell& cell : cells) {
        std::string column(all.substr(cell.begin, cell.length));
        if (column.empty()) {
          return make_error(ErrorCode::parse,
                            fmt::format("{}:{}: empty column name", table.name_, line));
        }
        if (std::find(table.columns_.begin(), table.columns_.end(), column) !=
            table.columns_.end()) {
          return make_error(ErrorCode::parse, fmt::format("{}:{}: column '{}' appears twice",
                                                          table.name_, line, column));
        }
        table.columns_.push_back(std::move(column));
      }
    } else {
      if (cells.size() != table.columns_.size()) {
        return make_error(ErrorCode::parse,
                          fmt::format("{}:{}: {} cells, the header has {}", table.name_, line,
                                      cells.size(), table.columns_.size()));
      }
      table.cells_.insert(table.cells_.end(), cells.begin(), cells.end());
      table.lines_.push_back(line);
    }
  }
  if (table.columns_.empty()) {
    return make_error(ErrorCode::parse, fmt::format("{}: no header row", table.name_));
  }
  return table;
}

Result<std::size_t> CsvTable::find(std::string_view column) const {
  const auto found = std::find(columns_.begin(), columns_.end(), column);
  if (found == columns_.end()) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: missing column '{}'", name_, column));
  }
  return static_cast<std::size_t>(found - columns_.begin());
}

std::string_view CsvTable::cell(std::size_t row, std::size_t column) const {
  const Cell& c = cells_[row * columns_.size() + column];
  return std::string_view(text_).substr(c.begin, c.length);
}

Result<std::vector<double>> CsvTable::numbers(std::string_view column) const {
  const auto index = find(column);
  if (!index) return tl::unexpected(index.error());
  std::vector<double> values;
  values.reserve(rows());
  for (std::size_t row = 0; row < rows(); ++row) {
    const auto value = parse_number(cell(row, *index));
    if (!value) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: column '{}': '{}' is not a number", name_, lines_[row],
                                    column, cell(row, *index)));
    }
    values.push_back(*value);
  }
  return values;
}

Result<std::vector<std::string_view>> CsvTable::texts(std::string_view column) const {
  const auto index = find(column);
  if (!index) return tl::unexpected(index.error());
  std::vector<std::string_view> values;
  values.reserve(rows());
  for (std::size_t row = 0; row < rows(); ++row) values.push_back(cell(row, *index));
  return values;
}

}  // namespace emit::verify
