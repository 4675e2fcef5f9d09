// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <map>
#include <utility>

#include "emit/config/load.hpp"

namespace emit::config {
namespace {

/// A table of the text: the first level, a section, or an element of an array of tables.
struct PrintedTable {
  std::string section;
  std::size_t index = 0;  ///< place in the array of tables
  bool in_array = false;
  std::vector<ConfigValue> values;

  /// Returns the name without quotes that select an element; empty where brackets would not take
  /// it.
  [[nodiscard]] std::string name() const {
    for (const ConfigValue& one : values) {
      if (one.key != "name" && one.key != "band") continue;
      if (one.value.size() < 3 || one.value.front() != '"') continue;
      const std::string text = one.value.substr(1, one.value.size() - 2);
      const bool number = text.find_first_not_of("0123456789") == std::string::npos;
      return number || text.find_first_of("[]\\") != std::string::npos ? std::string() : text;
    }
    return {};
  }
};

/// Splits the text off at the next line end.
std::string_view take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(' ');
  return first == std::string_view::npos ? std::string_view() : text.substr(first);
}

/// Reads the tables. The writer puts a value on one line, or an array of tables with one element a
/// line between brackets of their own.
std::vector<PrintedTable> tables_of(std::string_view text) {
  std::vector<PrintedTable> tables(1);
  std::map<std::string, std::size_t, std::less<>> elements;
  while (!text.empty()) {
    const std::string_view line = take_line(text);
    if (line.starts_with("[")) {
      PrintedTable& table = tables.emplace_back();
      table.in_array = line.starts_with("[[");
      const std::size_t brackets = table.in_array ? 2 : 1;
      table.section = line.substr(brackets, line.size() - 2 * brackets);
      if (table.in_array) table.index = elements[table.section]++;
      continue;
    }
    const std::size_t equals = line.find(" = ");
    if (equals == std::string_view::npos) continue;
    ConfigValue value{std::string(line.substr(0, equals)), std::string(line.substr(equals + 3))};
    if (value.value == "[") {
      for (std::string_view next = take_line(text); next != "]"; next = take_line(text)) {
        value.value += (value.value.size() > 1 ? " " : "") + std::string(trimmed(next));
        if (text.empty()) break;
      }
      value.value += "]";
    }
    tables.back().values.push_back(std::move(value));
  }
  return tables;
}

}  // namespace

std::vector<ConfigValue> list_values(std::string_view printed) {
  std::vector<PrintedTable> tables = tables_of(printed);
  std::map<std::pair<std::string, std::string>, int> bearers;
  for (const PrintedTable& table : tables) {
    if (table.in_array) ++bearers[{table.section, table.name()}];
  }
  std::vector<ConfigValue> out;
  for (PrintedTable& table : tables) {
    std::string prefix = table.section;
    if (table.in_array) {
      const std::string name = table.name();
      const bool unique = !name.empty() && bearers[{table.section, name}] == 1;
      prefix += unique ? fmt::format("[{}]", name) : fmt::format("[{}]", table.index);
    }
    if (!prefix.empty()) prefix += ".";
    for (ConfigValue& value : table.values) {
      out.push_back({prefix + value.key, std::move(value.value)});
    }
  }
  return out;
}

}  // namespace emit::config
