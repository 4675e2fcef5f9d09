// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <span>

#include "emit/physics/foster.hpp"

/// Foster networks as columns of lumps in depth, and back (physics.md eq. 22). A network and its
/// column are the same linear system in two sets of coordinates: the modes of the network relax on
/// their own, and the lumps of the column lie one below the other, so that neighbouring columns can
/// exchange heat at equal depth.
namespace emit::physics {

/// Ladder of lumps, the outermost first (Cauer form). The first lump is the surface itself:
///
///   C_0 T_0' = q + g_0 (T_1 - T_0),   C_l T_l' = g_l-1 (T_l-1 - T_l) + g_l (T_l+1 - T_l)
///
/// and the last conductance leads to the base. Entries from `count` on are zero.
struct ConductionColumn {
  std::size_t count = 0;
  FosterState<double> heat_j_m2_k{};         ///< C_l
  FosterState<double> conductance_w_m2_k{};  ///< g_l
};

/// Returns the column that responds to a flux at its surface as the network does. All its entries
/// are positive, since all resistances and time constants are. It is found by the Lanczos recursion
/// on the modes (Golub and Van Loan, Matrix Computations, 10.1). A network without modes gives a
/// column without lumps. Any thread. RT-safe.
[[nodiscard]] ConductionColumn column_of_network(const FosterNetwork& network) noexcept;

/// Modes of a column. Lump temperatures and modes are kelvins above the base.
struct ColumnModes {
  using Matrix = std::array<FosterState<double>, kMaxFosterModes>;

  FosterNetwork network;
  FosterState<double> base_shares{};  ///< see base_shares(); exact here
  Matrix lump_from_mode{};            ///< T_l = sum_i lump_from_mode[l][i] x_i
  Matrix mode_from_lump{};            ///< x_i = sum_l mode_from_lump[i][l] T_l
};
/// Returns the modes of a column, fastest first. Any thread. RT-safe.
/// @pre the entries of its lumps are positive
[[nodiscard]] ColumnModes modes_of_column(const ConductionColumn& column) noexcept;

/// Material of a stack that the lumps of a column stand for. Each lump is spread over the depths
/// between its neighbours, as a hat function of the resistance from the surface; the shares of all
/// lumps and of the base add up to 1 at every depth.
struct ColumnDepths {
  FosterState<double> sideways_w_k{};  ///< integral of conductivity over depth, by lump
  FosterState<double> depth_m{};       ///< mean depth of that integral
  /// Share of it that lies above a depth `cut_m`, by lump.
  [[nodiscard]] FosterState<double> above(std::span<const StackLayer> layers,
                                          const ConductionColumn& column, double cut_m) const;
};
/// Returns them for a column of these layers. @pre layers are positive and there is at least one
[[nodiscard]] ColumnDepths depths_of_column(std::span<const StackLayer> layers,
                                            const ConductionColumn& column);

/// Returns what is left of a column where the material ends at depth `cut_m`, as it does beside the
/// edge of a body: another face owns the rest. What lies deeper keeps a small share, so that the
/// column stays a column.
[[nodiscard]] ConductionColumn cut_column(std::span<const StackLayer> layers,
                                          const ConductionColumn& column, double cut_m);

}  // namespace emit::physics
