// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/column_cells.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace emit::physics {
namespace {

/// Time after which the outermost cell has followed the surface, s: cells do not get thinner than
/// heat gets in about that time.
constexpr double kFirstCellS = 200.0;

/// Square root of the time that heat takes to cross a metre of a layer, s^1/2 m-1.
double slowness(const StackLayer& layer) noexcept {
  return std::sqrt(layer.volumetric_heat_j_m3_k / layer.conductivity_w_m_k);
}

/// Returns how thick a cell between two depths is for its depth; depths are counted in s^1/2.
double excess(double top, double bottom) noexcept {
  return (bottom - top) / (top + std::sqrt(kFirstCellS));
}

}  // namespace

std::size_t ColumnCells::at(double depth_m) const noexcept {
  std::size_t l = 0;
  while (l + 1 < count && depth_m >= top_m[l + 1]) ++l;
  return l;
}

ColumnCells column_cells(std::span<const StackLayer> layers) {
  // Begin with an end at every face of a layer; ends are counted in s^1/2 from the surface.
  std::vector<double> ends{0.0};
  for (const StackLayer& layer : layers) {
    ends.push_back(ends.back() + layer.thickness_m * slowness(layer));
  }
  const std::vector<double> faces = ends;
  // Join cells that are thinnest for their depth while there are too many.
  while (ends.size() > kMaxColumnCells + 1) {
    std::size_t best = 1;
    for (std::size_t i = 1; i + 1 < ends.size(); ++i) {
      if (excess(ends[i - 1], ends[i + 1]) < excess(ends[best - 1], ends[best + 1])) best = i;
    }
    ends.erase(ends.begin() + static_cast<std::ptrdiff_t>(best));
  }
  // Halve cells that are thickest for their depth while there is room.
  while (ends.size() < kMaxColumnCells + 1) {
    std::size_t worst = 0;
    for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
      if (excess(ends[i], ends[i + 1]) > excess(ends[worst], ends[worst + 1])) worst = i;
    }
    const double first = std::sqrt(kFirstCellS);
    const double middle = std::sqrt((ends[worst] + first) * (ends[worst + 1] + first)) - first;
    ends.insert(ends.begin() + static_cast<std::ptrdiff_t>(worst) + 1, middle);
  }
  // Sum up what each cell holds.
  ColumnCells cells;
  cells.count = ends.size() - 1;
  for (std::size_t l = 0; l < cells.count; ++l) {
    double thickness_m = 0.0;
    double sideways_w_k = 0.0;
    for (std::size_t i = 0; i < layers.size(); ++i) {
      const double part = std::min(ends[l + 1], faces[i + 1]) - std::max(ends[l], faces[i]);
      if (!(part > 0.0)) continue;
      const double part_m = part / slowness(layers[i]);
      thickness_m += part_m;
      cells.heat_j_m2_k[l] += part_m * layers[i].volumetric_heat_j_m3_k;
      cells.resistance_m2k_w[l] += part_m / layers[i].conductivity_w_m_k;
      sideways_w_k += part_m * layers[i].conductivity_w_m_k;
    }
    cells.conductivity_w_m_k[l] = sideways_w_k / thickness_m;
    cells.top_m[l + 1] = cells.top_m[l] + thickness_m;
  }
  return cells;
}

}  // namespace emit::physics
