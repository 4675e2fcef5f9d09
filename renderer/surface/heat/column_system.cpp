// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/column_system.hpp"

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
  // Walk from every column that has no island yet to all that heat connects with it.
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
          if (!(link.conductance_w_m2_k > 0.0F)) continue;
          island_of_[link.column] = island;
          area_m2_[link.column] = static_cast<double>(all.columns[link.column].area_m2) /
                                  static_cast<double>(all.columns[first].area_m2);
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

double ColumnSystem::dot(std::uint32_t column, const Cells& a, const Cells& b) const noexcept {
  float own = 0.0F;
  for (std::size_t l = 0; l < kMaxColumnCells; ++l) own += a[l] * b[l];
  return area_m2_[column] * static_cast<double>(own);
}

void ColumnSystem::form_residual(std::uint32_t column) noexcept {
  const ColumnEquations& balance = equations_[column];
  physics::CellState<double> diagonal = balance.diagonal_w_m2_k;
  for (std::size_t l = 0; l < balance.count; ++l) {
    diagonal[l] += static_cast<double>(beside_w_m2_k_[column][l]);
    diagonal_w_m2_k_[column][l] = static_cast<float>(diagonal[l]);
    below_w_m2_k_[column][l] = static_cast<float>(balance.below_w_m2_k[l]);
  }
  const physics::CellState<double> left = product(column, diagonal, balance.below_w_m2_k, cells_k_);
  for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
    residual_[column][l] = static_cast<float>(balance.right_w_m2[l] - left[l]);
  }
}

ColumnSystem::Part ColumnSystem::precondition(std::uint32_t column) noexcept {
  Part out;
  solved_[column] = solve_column(equations_[column].count, diagonal_w_m2_k_[column],
                                 below_w_m2_k_[column], residual_[column]);
  for (const float value_k : solved_[column]) out.most_k = std::max(out.most_k, std::abs(value_k));
  out.size = dot(column, residual_[column], solved_[column]);
  return out;
}

void ColumnSystem::turn_direction(std::uint32_t column, float turn) noexcept {
  for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
    direction_[column][l] = solved_[column][l] + turn * direction_[column][l];
  }
}

double ColumnSystem::multiply(std::uint32_t column) noexcept {
  product_[column] = product(column, diagonal_w_m2_k_[column], below_w_m2_k_[column], direction_);
  return dot(column, direction_[column], product_[column]);
}

void ColumnSystem::move(std::uint32_t column, float way) noexcept {
  for (std::size_t l = 0; l < kMaxColumnCells; ++l) {
    cells_k_[column][l] += static_cast<double>(way * direction_[column][l]);
    residual_[column][l] -= way * product_[column][l];
  }
}

std::uint64_t ColumnSystem::bytes() const noexcept {
  const auto bytes_of = [](const auto& values) { return values.capacity() * sizeof(values[0]); };
  std::uint64_t sum = bytes_of(members_) + bytes_of(island_end_) + bytes_of(island_of_) +
                      bytes_of(area_m2_) + bytes_of(beside_w_m2_k_) + bytes_of(equations_) +
                      bytes_of(cells_k_);
  for (const std::vector<Cells>* vector :
       {&residual_, &solved_, &direction_, &product_, &diagonal_w_m2_k_, &below_w_m2_k_}) {
    sum += bytes_of(*vector);
  }
  return sum;
}

void ColumnSystem::solve(std::size_t island) noexcept {
  const std::span<const std::uint32_t> columns = this->columns(island);
  const auto precondition_all = [&] {
    Part sum;
    for (const std::uint32_t c : columns) {
      const Part part = precondition(c);
      sum.size += part.size;
      sum.most_k = std::max(sum.most_k, part.most_k);
    }
    return sum;
  };
  for (const std::uint32_t c : columns) form_residual(c);
  Part left = precondition_all();
  float turn = 0.0F;
  for (int step = 0; step < kMostSolveSteps && left.most_k > kSolvedK && left.size > 0.0; ++step) {
    for (const std::uint32_t c : columns) turn_direction(c, turn);
    double along = 0.0;
    for (const std::uint32_t c : columns) along += multiply(c);
    const auto way = static_cast<float>(left.size / along);
    for (const std::uint32_t c : columns) move(c, way);
    const Part next = precondition_all();
    turn = static_cast<float>(next.size / left.size);
    left = next;
  }
}

}  // namespace emit::renderer
