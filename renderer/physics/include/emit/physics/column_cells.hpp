// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <span>

#include "emit/physics/foster.hpp"

/// A stack of layers cut into cells in depth, for heat that moves along the surface (physics.md
/// eq. 22). A cell is a finite volume: its heat stands at its centre, and resistances lead from
/// there to both of its ends.
namespace emit::physics {

/// Largest number of cells of a column.
inline constexpr std::size_t kMaxColumnCells = 8;

/// One number for each cell of a column, the outermost first.
template <class Real>
using CellState = std::array<Real, kMaxColumnCells>;

/// Cells of a stack. Entries from `count` on are zero.
struct ColumnCells {
  std::size_t count = 0;
  /// Depth of the upper end of each cell, then that of the base, m.
  std::array<double, kMaxColumnCells + 1> top_m{};
  CellState<double> heat_j_m2_k{};
  CellState<double> resistance_m2k_w{};    ///< from the upper to the lower end
  CellState<double> conductivity_w_m_k{};  ///< sideways: the mean over depth

  /// Conductance from the centre of cell `l` to that of the next one, or to the base, W m-2 K-1.
  /// @pre l < count
  [[nodiscard]] double below_w_m2_k(std::size_t l) const noexcept {
    const double next = l + 1 < count ? resistance_m2k_w[l + 1] : 0.0;
    return 2.0 / (resistance_m2k_w[l] + next);
  }
  /// Conductance from the surface to the centre of the first cell, W m-2 K-1. @pre count > 0
  [[nodiscard]] double surface_w_m2_k() const noexcept { return 2.0 / resistance_m2k_w[0]; }
  [[nodiscard]] double middle_m(std::size_t l) const noexcept {
    return 0.5 * (top_m[l] + top_m[l + 1]);
  }
  [[nodiscard]] double thickness_m(std::size_t l) const noexcept { return top_m[l + 1] - top_m[l]; }
  /// Returns the cell that holds a depth; the last one below the base. @pre count > 0
  [[nodiscard]] std::size_t at(double depth_m) const noexcept;
};

/// Cuts a stack into cells whose thickness grows with depth, by the time that heat takes to get
/// there: sqrt(t) = sum d sqrt(rho c / lambda). Every layer has cells of its own, unless there are
/// more than kMaxColumnCells layers. Setup only. @pre layers are finite and positive
[[nodiscard]] ColumnCells column_cells(std::span<const StackLayer> layers);

}  // namespace emit::physics
