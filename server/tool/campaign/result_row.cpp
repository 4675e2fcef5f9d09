// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/result_row.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>

#include "tool/support/replacing_file.hpp"

namespace emit::tool {
namespace {

constexpr std::string_view kLastLine = "# complete";

/// A cell of CSV: quotes stand around a text with a comma, a quote or a new line.
std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c == '\n' ? ' ' : c;
  }
  return out + "\"";
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool inside = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"' && inside && i + 1 < line.size() && line[i + 1] == '"') {
      cells.back() += '"';
      ++i;
    } else if (c == '"') {
      inside = !inside;
    } else if (c == ',' && !inside) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

}  // namespace

void ResultRow::set(const std::string& column, std::string text) {
  const auto found = std::ranges::find(cells_, column, &std::pair<std::string, std::string>::first);
  if (found != cells_.end()) {
    found->second = std::move(text);
  } else {
    cells_.emplace_back(column, std::move(text));
  }
}

void ResultRow::set(const std::string& column, double value) {
  set(column, fmt::format("{:.9g}", value));
}

std::string ResultRow::text(const std::string& column) const {
  const auto found = std::ranges::find(cells_, column, &std::pair<std::string, std::string>::first);
  return found == cells_.end() ? std::string() : found->second;
}

double ResultRow::number(const std::string& column) const {
  const std::string cell = text(column);
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  return error == std::errc() && end == cell.data() + cell.size()
             ? value
             : std::numeric_limits<double>::quiet_NaN();
}

std::string result_table(const std::vector<ResultRow>& rows) {
  std::vector<std::string> columns;
  for (const ResultRow& row : rows) {
    for (const auto& [column, cell] : row.cells()) {
      if (std::ranges::find(columns, column) == columns.end()) columns.push_back(column);
    }
  }
  std::string out;
  for (std::size_t c = 0; c < columns.size(); ++c) out += (c > 0 ? "," : "") + csv_cell(columns[c]);
  out += '\n';
  for (const ResultRow& row : rows) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      out += (c > 0 ? "," : "") + csv_cell(row.text(columns[c]));
    }
    out += '\n';
  }
  return out;
}

physics::Result<void> write_result_row(const std::filesystem::path& file,
                                       const std::string& identity, const ResultRow& row) {
  auto out = ReplacingFile::create(file);
  if (!out) return tl::unexpected(std::move(out.error()));
  const std::string text = fmt::format("# {}\n{}{}\n", identity, result_table({row}), kLastLine);
  if (auto done = out->write(text); !done) return done;
  return out->commit();
}

std::optional<ResultRow> read_result_row(const std::filesystem::path& file,
                                         const std::string& identity) {
  std::ifstream in(file);
  std::string first;
  std::string header;
  std::string cells;
  std::string last;
  if (!std::getline(in, first) || !std::getline(in, header) || !std::getline(in, cells) ||
      !std::getline(in, last) || first != "# " + identity || last != kLastLine) {
    return std::nullopt;
  }
  const std::vector<std::string> columns = cells_of(header);
  const std::vector<std::string> values = cells_of(cells);
  if (columns.size() != values.size()) return std::nullopt;
  ResultRow row;
  for (std::size_t c = 0; c < columns.size(); ++c) row.set(columns[c], values[c]);
  return row;
}

}  // namespace emit::tool
