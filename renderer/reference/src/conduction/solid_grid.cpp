// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solid_grid.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::reference {
namespace {

/// Returns the smallest wanted cell length at a place.
double wanted_size(const GradedLines& wanted, double x) {
  double size = wanted.max_size_m;
  for (const SizeWish& wish : wanted.wishes) {
    const double away = std::max({0.0, wish.low_m - x, x - wish.high_m});
    size = std::min(size, wish.size_m + wanted.growth_frac * away);
  }
  return size;
}

/// Adds the lines after `from` up to `to`, at equal steps of the integral of 1 / size.
void fill_span(const GradedLines& wanted, double from, double to, std::vector<double>& lines) {
  double smallest = to - from;
  for (const SizeWish& wish : wanted.wishes) smallest = std::min(smallest, wish.size_m);
  // Tabulate the number of cells up to every sample by the midpoint rule.
  const auto samples =
      static_cast<std::size_t>(std::clamp(4.0 * (to - from) / smallest, 64.0, 200000.0));
  std::vector<double> cells(samples + 1, 0.0);
  const double step = (to - from) / static_cast<double>(samples);
  for (std::size_t i = 0; i < samples; ++i) {
    const double middle = from + (static_cast<double>(i) + 0.5) * step;
    cells[i + 1] = cells[i] + wanted.refine * step / wanted_size(wanted, middle);
  }
  // Invert the table at whole numbers of cells.
  const auto count = static_cast<std::size_t>(std::max(1.0, std::ceil(cells.back() - 1e-6)));
  std::size_t at = 0;
  for (std::size_t line = 1; line < count; ++line) {
    const double target = cells.back() * static_cast<double>(line) / static_cast<double>(count);
    while (cells[at + 1] < target) ++at;
    const double share = (target - cells[at]) / (cells[at + 1] - cells[at]);
    lines.push_back(from + (static_cast<double>(at) + share) * step);
  }
  lines.push_back(to);
}

}  // namespace

std::vector<double> graded_lines(const GradedLines& wanted, double merge_m) {
  EMIT_CHECK(!wanted.fixed_m.empty());
  // Merge fixed places that are too close together.
  std::vector<double> fixed = wanted.fixed_m;
  std::sort(fixed.begin(), fixed.end());
  std::vector<double> kept{fixed.front()};
  for (const double place : fixed) {
    if (place > kept.back() + merge_m) kept.push_back(place);
  }
  EMIT_CHECK_OP(kept.size(), >=, 2U);
  // Fill the spans between the fixed lines.
  std::vector<double> lines{kept.front()};
  for (std::size_t i = 0; i + 1 < kept.size(); ++i) fill_span(wanted, kept[i], kept[i + 1], lines);
  return lines;
}

}  // namespace emit::reference
