// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "surface/heat/column_equations.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Balance of all columns of a scene over an interval. Columns that heat connects form an island;
/// islands are solved on their own. Different islands may be used at the same time. RT-safe but for
/// the constructor.
class ColumnSystem {
 public:
  /// Error of a temperature at which solve() ends, K.
  static constexpr float kSolvedK = 3e-3F;

  /// Keeps a reference to `all`, whose columns stay as they are.
  explicit ColumnSystem(const SurfaceSamples& all);

  [[nodiscard]] std::size_t islands() const noexcept { return island_end_.size(); }
  /// Returns the island of a column.
  [[nodiscard]] std::uint32_t island(std::uint32_t column) const noexcept {
    return island_of_[column];
  }
  /// Returns the columns of an island, ascending.
  [[nodiscard]] std::span<const std::uint32_t> columns(std::size_t island) const noexcept {
    const std::uint32_t begin = island == 0 ? 0 : island_end_[island - 1];
    return std::span(members_).subspan(begin, island_end_[island] - begin);
  }

  /// Equations of a column without its neighbours, to be filled before solve().
  [[nodiscard]] ColumnEquations& equations(std::uint32_t column) noexcept {
    return equations_[column];
  }
  /// Temperatures of the cells of a column: the guess that solve() begins with, then the result.
  [[nodiscard]] physics::CellState<double>& cells_k(std::uint32_t column) noexcept {
    return cells_k_[column];
  }
  /// Solves the balance of the columns of an island with each other, by conjugate gradients whose
  /// preconditioner solves every column with its neighbours held. The matrix is symmetric, weighted
  /// by the areas of samples, and an M-matrix.
  void solve(std::size_t island) noexcept;

  [[nodiscard]] std::uint64_t bytes() const noexcept;

  // Steps of the method for one column, for a caller that spreads them over time (ColumnSolve).
  // Each may run for many columns at once, but only after the one before has run for all columns of
  // the island.

  /// A column adds this to the sums over its island.
  struct Part {
    double size = 0.0;    ///< to the square of the residual, or of the direction
    float most_k = 0.0F;  ///< greatest temperature that the residual is worth
  };
  /// Forms what equations() and cells_k() leave unbalanced.
  void form_residual(std::uint32_t column) noexcept;
  /// Solves a column for its residual with its neighbours held.
  Part precondition(std::uint32_t column) noexcept;
  /// Adds `turn` of the old direction to the new one.
  void turn_direction(std::uint32_t column, float turn) noexcept;
  /// Multiplies the direction with the matrix. Returns their product.
  [[nodiscard]] double multiply(std::uint32_t column) noexcept;
  /// Moves the cells along the direction.
  void move(std::uint32_t column, float way) noexcept;

 private:
  /// The residual takes float32 well: it is formed once in float64.
  using Cells = physics::CellState<float>;

  /// Returns the product of two vectors in a column, in the measure in which the matrix is
  /// symmetric.
  [[nodiscard]] double dot(std::uint32_t column, const Cells& a, const Cells& b) const noexcept;

  /// Returns the heat that leaves a column, per area of its sample, if cells have the values `x`.
  template <class Real>
  [[nodiscard]] physics::CellState<Real> product(
      std::uint32_t column, const physics::CellState<Real>& diagonal,
      const physics::CellState<Real>& below,
      const std::vector<physics::CellState<Real>>& x) const noexcept;

  const SurfaceSamples& all_;
  std::vector<std::uint32_t> members_;     ///< columns, island by island
  std::vector<std::uint32_t> island_end_;  ///< end of each island in `members_`
  std::vector<std::uint32_t> island_of_;   ///< by column
  std::vector<double> area_m2_;  ///< by column, in units of that of the first one of its island
  std::vector<Cells> beside_w_m2_k_;  ///< by column: sum of the conductances of each cell
  std::vector<ColumnEquations> equations_;
  std::vector<physics::CellState<double>> cells_k_;
  // Balance and vectors of the method, by column.
  std::vector<Cells> diagonal_w_m2_k_;
  std::vector<Cells> below_w_m2_k_;
  std::vector<Cells> residual_;
  std::vector<Cells> solved_;
  std::vector<Cells> direction_;
  std::vector<Cells> product_;
};

}  // namespace emit::renderer
