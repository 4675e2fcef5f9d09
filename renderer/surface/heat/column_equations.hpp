// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>

#include "emit/physics/column_cells.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Balance of the cells of a column at the end of an interval, without the heat of its neighbours
/// (physics.md eq. 22):
///
///   diagonal_l T_l - below_l-1 T_l-1 - below_l T_l+1 = right_l
///
/// all per area of the sample. A neighbour adds its conductance to the diagonal and, times its
/// temperature, to the right side, so that the matrix stays an M-matrix.
struct ColumnEquations {
  std::size_t count = 0;
  physics::CellState<double> diagonal_w_m2_k{};
  physics::CellState<double>
      below_w_m2_k{};  ///< to the next cell; that of the last one is not used
  physics::CellState<double> right_w_m2{};
  physics::CellState<double> alone_k{};  ///< cells at the end if there were no neighbours at all
  /// Difference that neighbours make to the surface: surface_frac T_0 + aside_offset_k.
  double surface_frac = 1.0;
  double aside_offset_k = 0.0;

  /// Returns the difference that neighbours make to the surface if the cells end like this.
  [[nodiscard]] double aside_k(const physics::CellState<double>& cells_k) const noexcept {
    return surface_frac * cells_k[0] + aside_offset_k;
  }
};

/// Solves such a balance for the `count` temperatures; the rest are 0. RT-safe.
/// @pre the matrix is diagonally dominant
template <class Real>
[[nodiscard]] physics::CellState<Real> solve_column(
    std::size_t count, const physics::CellState<Real>& diagonal,
    const physics::CellState<Real>& below, const physics::CellState<Real>& right) noexcept {
  physics::CellState<Real> pivot{};
  physics::CellState<Real> out{};
  pivot[0] = diagonal[0];
  out[0] = right[0];
  for (std::size_t l = 1; l < count; ++l) {
    const Real factor = below[l - 1] / pivot[l - 1];
    pivot[l] = diagonal[l] - factor * below[l - 1];
    out[l] = right[l] + factor * out[l - 1];
  }
  for (std::size_t l = count; l-- > 0;) {
    if (l + 1 < count) out[l] += below[l] * out[l + 1];
    out[l] /= pivot[l];
  }
  return out;
}

/// Keeps the end of an interval in the state of a sample.
inline void keep_cells(const ColumnEquations& equations, const physics::CellState<double>& cells_k,
                       SampleState& state) noexcept {
  state.aside_k = static_cast<float>(equations.aside_k(cells_k));
  for (std::size_t l = 0; l < physics::kMaxColumnCells; ++l) {
    state.alone_k[l] = static_cast<float>(equations.alone_k[l]);
    state.cells_k[l] = static_cast<float>(cells_k[l]);
  }
}

}  // namespace emit::renderer
