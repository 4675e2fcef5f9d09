// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/column_system.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace emit::renderer {
namespace {

using physics::kMaxColumnCells;
constexpr std::uint32_t kNoIsland = 0xffffffffU;
/// Steps after which solve() ends in any case. Hundreds of columns in a row need some tens.
constexpr int kMostSolveSteps = 500;

}  // namespace

ColumnSystem::ColumnSystem(const SurfaceSamples& all) : all_(all) {
  const std::size_t count = all.columns.size();
  island_of_.assign(count, kNoIsland);
  area_m2_.resize(count);
  beside_w_m2_k_.resize(count);
  equations_.resize(count);
  for (std::vector<Cells>* vector :
       {&residual_, &solved_, &direction_, &product_, &diagonal_w_m2_k_, &below_w_m2_k_}) {
    vector->resize(count);
  }
  cells_k_.resize(count);
  for (std::size_t c = 0; c < count; ++c) {
    const SampleColumn& column = all.columns[c];
    for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
      for (std::uint32_t k = column.first_link[l]; k < column.first_link[l + 1]; ++k) {
        beside_w_m2_k_[c][l] += all.links[k].conductance_w_m2_k;
      }
    }
  }
  // Walk from every column that has no island yet to all that heat connects with it. Conductances
  // are per area of the own sample, so that their ratio gives the areas.
  for (std::uint32_t first = 0; first < count; ++first) {
    if (island_of_[first] != kNoIsland) continue;
    const auto island = static_cast<std::uint32_t>(island_end_.size());
    const std::size_t begin = members_.size();
    island_of_[first] = island;
    area_m2_[first] = 1.0;
    members_.push_back(first);
    for (std::size_t i = begin; i < members_.size(); ++i) {
      const std::uint32_t c = members_[i];
      const SampleColumn& column = all.columns[c];
      for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
        for (std::uint32_t k = column.first_link[l]; k < column.first_link[l + 1]; ++k) {
          const CellLink& link = all.links[k];
          if (island_of_[link.column] != kNoIsland) continue;
          const SampleColumn& other = all.columns[link.column];
          double back_w_m2_k = 0.0;
          for (std::uint32_t b = other.first_link[link.cell]; b < other.first_link[link.cell + 1];
               ++b) {
            if (all.links[b].column == c && all.links[b].cell == l) {
              back_w_m2_k = all.links[b].conductance_w_m2_k;
            }
          }
          if (!(back_w_m2_k > 0.0) || !(link.conductance_w_m2_k > 0.0F)) continue;
          island_of_[link.column] = island;
          area_m2_[link.column] = area_m2_[c] * link.conductance_w_m2_k / back_w_m2_k;
          members_.push_back(link.column);
        }
      }
    }
    std::sort(members_.begin() + static_cast<std::ptrdiff_t>(begin), members_.end());
    island_end_.push_back(static_cast<std::uint32_t>(members_.size()));
  }
}

template <class Real>
physics::CellState<Real> ColumnSystem::product(
    std::uint32_t column, const physics::CellState<Real>& diagonal,
    const physics::CellState<Real>& below,
    const std::vector<physics::CellState<Real>>& x) const noexcept {
  const SampleColumn& own = all_.columns[column];
  const physics::CellState<Real>& own_k = x[column];
  physics::CellState<Real> out{};
  for (std::size_t l = 0; l < equations_[column].count; ++l) {
    Real sum = diagonal[l] * own_k[l];
    if (l > 0) sum -= below[l - 1] * own_k[l - 1];
    if (l + 1 < equations_[column].count) sum -= below[l] * own_k[l + 1];
    for (std::uint32_t k = own.first_link[l]; k < own.first_link[l + 1]; ++k) {
      const CellLink& link = all_.links[k];
      sum -= static_cast<Real>(link.conductance_w_m2_k) * x[link.column][link.cell];
    }
    out[l] = sum;
  }
  return out;
}

void ColumnSystem::solve(std::size_t island) noexcept {
  const std::span<const std::uint32_t> columns = this->columns(island);
  // Solve each column for the residual with its neighbours held. Returns the greatest temperature
  // that it gives.
  const auto precondition = [&] {
    float most_k = 0.0F;
    for (const std::uint32_t c : columns) {
      solved_[c] =
          solve_column(equations_[c].count, diagonal_w_m2_k_[c], below_w_m2_k_[c], residual_[c]);
      for (const float value_k : solved_[c]) most_k = std::max(most_k, std::abs(value_k));
    }
    return most_k;
  };
  const auto dot = [&](const std::vector<Cells>& a, const std::vector<Cells>& b) {
    double sum = 0.0;
    for (const std::uint32_t c : columns) {
      float own = 0.0F;
      for (std::size_t l = 0; l < kMaxColumnCells; ++l) own += a[c][l] * b[c][l];
      sum += area_m2_[c] * static_cast<double>(own);
    }
    return sum;
  };
  for (const std::uint32_t c : columns) {
    const ColumnEquations& balance = equations_[c];
    physics::CellState<double> diagonal = balance.diagonal_w_m2_k;
    for (std::size_t l = 0; l < balance.count; ++l) {
      diagonal[l] += static_cast<double>(beside_w_m2_k_[c][l]);
      diagonal_w_m2_k_[c][l] = static_cast<float>(diagonal[l]);
      below_w_m2_k_[c][l] = static_cast<float>(balance.below_w_m2_k[l]);
    }
    const physics::CellState<double> left = product(c, diagonal, balance.below_w_m2_k, cells_k_);
    for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
      residual_[c][l] = static_cast<float>(balance.right_w_m2[l] - left[l]);
    }
  }
  float most_k = precondition();
  for (const std::uint32_t c : columns) direction_[c] = solved_[c];
  double size = dot(residual_, solved_);
  for (int step = 0; step < kMostSolveSteps && most_k > kSolvedK && size > 0.0; ++step) {
    for (const std::uint32_t c : columns) {
      product_[c] = product(c, diagonal_w_m2_k_[c], below_w_m2_k_[c], direction_);
    }
    const auto way = static_cast<float>(size / dot(direction_, product_));
    for (const std::uint32_t c : columns) {
      for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
        cells_k_[c][l] += static_cast<double>(way * direction_[c][l]);
        residual_[c][l] -= way * product_[c][l];
      }
    }
    most_k = precondition();
    const double next = dot(residual_, solved_);
    const auto turn = static_cast<float>(next / size);
    size = next;
    for (const std::uint32_t c : columns) {
      for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
        direction_[c][l] = solved_[c][l] + turn * direction_[c][l];
      }
    }
  }
}

}  // namespace emit::renderer
