// SPDX-License-Identifier: Apache-2.0
#include "csv.hpp"

#include <fmt/format.h>

#include <charconv>
#include <fstream>
#include <memory>

namespace emit::config {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

struct Cell {
  std::string_view text;  ///< trimmed
  std::uint32_t column = 1;
};

std::vector<Cell> split(std::string_view line) {
  std::vector<Cell> cells;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = line.find(',', begin);
    const std::size_t end = comma == std::string_view::npos ? line.size() : comma;
    std::size_t first = begin;
    std::size_t last = end;
    while (first < last && (line[first] == ' ' || line[first] == '\t')) {
      ++first;
    }
    while (last > first && (line[last - 1] == ' ' || line[last - 1] == '\t')) {
      --last;
    }
    cells.push_back({line.substr(first, last - first), static_cast<std::uint32_t>(first + 1)});
    if (comma == std::string_view::npos) {
      return cells;
    }
    begin = comma + 1;
  }
}

constexpr std::size_t kAbsent = static_cast<std::size_t>(-1);

/// Where each column of the specification is found in the file.
Result<std::vector<std::size_t>> read_header(const std::vector<Cell>& cells,
                                             const std::vector<CsvColumn>& columns,
                                             const Location& line_at) {
  std::vector<std::size_t> where(columns.size(), kAbsent);
  Diagnostics faults;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Location at = line_at;
    at.column = cells[i].column;
    std::vector<std::string_view> names;
    bool found = false;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      names.push_back(columns[c].name);
      if (columns[c].name == cells[i].text) {
        found = true;
        if (where[c] != kAbsent) {
          faults.add(at, fmt::format("column '{}' appears twice", cells[i].text));
        }
        where[c] = i;
      }
    }
    if (!found) {
      const std::string_view near = nearest_word(cells[i].text, names);
      faults.add(at, near.empty() ? fmt::format("unknown column '{}'", cells[i].text)
                                  : fmt::format("unknown column '{}', did you mean '{}'?",
                                                cells[i].text, near));
    }
  }
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (columns[c].required && where[c] == kAbsent) {
      Location at = line_at;
      at.column = 1;
      faults.add(at, fmt::format("column '{}' is missing", columns[c].name));
    }
  }
  if (!faults.empty()) {
    return tl::unexpected<physics::Error>(faults.error());
  }
  return where;
}

/// Fills one value of a row; an empty text means success.
std::string read_cell(const Cell& cell, const CsvColumn& column, std::optional<double>& number) {
  if (cell.text.empty()) {
    return column.required ? fmt::format("'{}' is empty", column.name) : std::string();
  }
  double value = 0.0;
  const char* begin = cell.text.data();
  const char* end = begin + cell.text.size();
  if (*begin == '+') {
    ++begin;
  }
  const auto parsed = std::from_chars(begin, end, value);
  if (parsed.ec != std::errc() || parsed.ptr != end) {
    return fmt::format("'{}' is '{}', which is not a number", column.name, cell.text);
  }
  if (!column.range.contains(value)) {
    return fmt::format("'{}' is {}, must be {}", column.name, value, column.range.to_string());
  }
  number = value;
  return {};
}

}  // namespace

Result<std::vector<CsvRow>> read_csv(const std::filesystem::path& file,
                                     const std::vector<CsvColumn>& columns) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(file, code)) {
    return make_error(ErrorCode::not_found, file.string() + ": no such file");
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    return make_error(ErrorCode::io, file.string() + ": cannot be opened");
  }
  const auto source = std::make_shared<const Source>(Source{file.string(), file.parent_path()});
  std::vector<CsvRow> rows;
  std::vector<std::size_t> where;
  std::size_t width = 0;
  Diagnostics faults;
  std::string line;
  for (std::uint32_t number = 1; std::getline(stream, line); ++number) {
    if (number == 1 && line.substr(0, 3) == "\xEF\xBB\xBF") {
      line.erase(0, 3);
    }
    if (!line.empty() && line.back() == '\r') {
      line.pop_back();
    }
    if (line.find_first_not_of(" \t") == std::string::npos || line[0] == '#') {
      continue;
    }
    const std::vector<Cell> cells = split(line);
    const Location line_at{source, number, 1};
    if (where.empty()) {
      Result<std::vector<std::size_t>> header = read_header(cells, columns, line_at);
      if (!header) {
        return tl::unexpected<physics::Error>(header.error());
      }
      where = std::move(*header);
      width = cells.size();
      continue;
    }
    if (cells.size() != width) {
      faults.add(line_at, fmt::format("{} values, the header has {}", cells.size(), width));
    } else {
      CsvRow row;
      row.line = number;
      row.numbers.resize(columns.size());
      row.texts.resize(columns.size());
      for (std::size_t c = 0; c < columns.size(); ++c) {
        if (where[c] == kAbsent) {
          continue;
        }
        const Cell& cell = cells[where[c]];
        row.texts[c] = std::string(cell.text);
        if (columns[c].text) {
          continue;
        }
        if (const std::string fault = read_cell(cell, columns[c], row.numbers[c]); !fault.empty()) {
          Location at = line_at;
          at.column = cell.column;
          faults.add(at, fault);
        }
      }
      rows.push_back(std::move(row));
    }
    // A file of another kind would otherwise give a message per line.
    if (faults.size() >= 10) {
      break;
    }
  }
  if (faults.empty() && stream.bad()) {
    return make_error(ErrorCode::io, file.string() + ": reading failed");
  }
  if (faults.empty() && rows.empty()) {
    faults.add({source, 0, 0},
               where.empty() ? "the file has no header row" : "the file has no rows");
  }
  if (!faults.empty()) {
    return tl::unexpected<physics::Error>(faults.error());
  }
  return rows;
}

}  // namespace emit::config
