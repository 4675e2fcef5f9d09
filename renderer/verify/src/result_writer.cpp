// SPDX-License-Identifier: Apache-2.0
#include "result_writer.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::verify {
namespace {

template <class Real>
std::string write(std::string_view header, std::span<const std::vector<Real>> columns) {
  std::string text(header);
  text += '\n';
  const std::size_t rows = columns.empty() ? 0 : columns.front().size();
  for (const auto& column : columns) EMIT_CHECK_OP(column.size(), ==, rows);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns.size(); ++column) {
      if (column > 0) text += ',';
      const Real value = columns[column][row];
      if (std::isnan(value)) {
        text += "nan";  // fmt would print the sign of a negative NaN
      } else {
        fmt::format_to(std::back_inserter(text), "{:.{}g}", value,
                       std::numeric_limits<Real>::max_digits10);
      }
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::string write_csv(std::string_view header, std::span<const std::vector<double>> columns) {
  return write<double>(header, columns);
}
std::string write_csv(std::string_view header, std::span<const std::vector<float>> columns) {
  return write<float>(header, columns);
}

}  // namespace emit::verify
