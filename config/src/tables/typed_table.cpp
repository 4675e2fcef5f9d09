// SPDX-License-Identifier: Apache-2.0
#include "typed_table.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "emit/physics/csv.hpp"
#include "tables.hpp"

namespace emit::config {

using physics::CsvCell;
using physics::CsvReader;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

constexpr std::size_t kAbsent = static_cast<std::size_t>(-1);

std::string quoted_list(const std::vector<std::string_view>& names) {
  std::string out;
  for (const std::string_view name : names) {
    out += fmt::format("{}'{}'", out.empty() ? "" : ", ", name);
  }
  return out;
}

/// Faults of a table, one line each.
class TableFaults {
 public:
  void add(std::string_view place, std::string_view text) {
    lines_.push_back({fmt::format("{}: {}", place, text), 0});
  }
  /// A further row has the fault of line `index`.
  void repeat(std::size_t index) { ++lines_[index].others; }
  [[nodiscard]] std::size_t size() const noexcept { return lines_.size(); }
  [[nodiscard]] tl::unexpected<physics::Error> error() const {
    std::string text;
    for (const Line& line : lines_) {
      text += (text.empty() ? "" : "\n") + line.text;
      if (line.others > 0) {
        text += fmt::format(" (and {} other row{})", line.others, line.others == 1 ? "" : "s");
      }
    }
    return make_error(ErrorCode::config, std::move(text));
  }

 private:
  struct Line {
    std::string text;
    std::size_t others = 0;
  };
  std::vector<Line> lines_;
};

/// Position in the file of every column of the list; kAbsent for those that the file lacks.
std::vector<std::size_t> match_header(const CsvReader& reader,
                                      const std::vector<TableColumn>& columns,
                                      TableFaults& faults) {
  std::vector<std::string_view> known;
  for (const TableColumn& column : columns) known.push_back(column.name);
  std::vector<std::size_t> where(columns.size(), kAbsent);
  const CsvCell* first_unknown = nullptr;
  std::vector<std::string_view> unknown;
  for (std::size_t i = 0; i < reader.header().size(); ++i) {
    const CsvCell& cell = reader.header()[i];
    const auto found = std::find(known.begin(), known.end(), cell.text);
    if (found == known.end()) {
      unknown.push_back(cell.text);
      first_unknown = first_unknown == nullptr ? &cell : first_unknown;
      continue;
    }
    std::size_t& place = where[static_cast<std::size_t>(found - known.begin())];
    if (place != kAbsent) {
      faults.add(reader.place_of(cell), fmt::format("column '{}' appears twice", cell.text));
    }
    place = i;
  }
  if (unknown.size() == 1) {
    const std::string hint = did_you_mean(unknown[0], known);
    faults.add(reader.place_of(*first_unknown),
               fmt::format("unknown column '{}'{}", unknown[0],
                           hint.empty() ? fmt::format(" (known: {})", quoted_list(known)) : hint));
  } else if (!unknown.empty()) {
    faults.add(
        reader.place_of(*first_unknown),
        fmt::format("unknown columns {} (known: {})", quoted_list(unknown), quoted_list(known)));
  }
  std::vector<std::string_view> missing;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (columns[c].required && where[c] == kAbsent) missing.push_back(columns[c].name);
  }
  if (!missing.empty()) {
    faults.add(fmt::format("{}:{}:1", reader.name(), reader.line()),
               fmt::format("{} {} {} missing", missing.size() == 1 ? "column" : "columns",
                           quoted_list(missing), missing.size() == 1 ? "is" : "are"));
  }
  return where;
}

/// Returns what a number looks like that is out of its range; may be empty.
std::string unit_hint(std::string_view column, double value) {
  if (column == "time_s") return physics::unix_time_hint(value);
  return column == "wavelength_um" ? wavelength_hint(value) : std::string();
}

/// Reads one number of a row; an empty text means success.
std::string read_number_cell(const CsvCell& cell, const TableColumn& column,
                             std::optional<double>& number) {
  if (cell.text.empty()) {
    return column.required ? fmt::format("'{}' is empty", column.name) : std::string();
  }
  const std::optional<double> value = physics::csv_number(cell.text);
  if (!value) {
    return fmt::format("'{}': {}", column.name, physics::not_a_number_text(cell.text));
  }
  if (!column.range.contains(*value)) {
    return fmt::format("'{}' is {}, must be {}{}", column.name, *value, column.range.to_string(),
                       unit_hint(column.name, *value));
  }
  number = value;
  return {};
}

}  // namespace

Result<std::vector<TableRow>> read_typed_table(const std::filesystem::path& file,
                                               const std::vector<TableColumn>& columns) {
  Result<CsvReader> reader = CsvReader::open(file);
  if (!reader) return tl::unexpected(std::move(reader.error()));
  TableFaults faults;
  const std::vector<std::size_t> where = match_header(*reader, columns, faults);
  if (faults.size() > 0) return faults.error();

  std::vector<TableRow> rows;
  std::vector<std::size_t> fault_of(columns.size(), kAbsent);
  while (true) {
    const Result<bool> more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    TableRow& row = rows.emplace_back();
    row.line = reader->line();
    row.numbers.resize(columns.size());
    row.texts.resize(columns.size());
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (where[c] == kAbsent) continue;
      const CsvCell& cell = reader->row()[where[c]];
      row.texts[c] = cell.text;
      if (columns[c].text) continue;
      const std::string fault = read_number_cell(cell, columns[c], row.numbers[c]);
      if (fault.empty()) continue;
      if (fault_of[c] != kAbsent) {
        faults.repeat(fault_of[c]);
      } else {
        fault_of[c] = faults.size();
        faults.add(reader->place_of(cell), fault);
      }
    }
  }
  if (faults.size() > 0) return faults.error();
  if (rows.empty()) {
    return make_error(ErrorCode::config, fmt::format("{}: the file has no rows", file.string()));
  }
  return rows;
}

}  // namespace emit::config
