// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "emit/reference/layer_solver.hpp"

/// Start of surfaces that nobody has stated a temperature for.
namespace emit::reference {

/// Profile that a day which repeats itself without end leaves at its start.
struct BalancedStart {
  double mean_k = 0.0;         ///< mean temperature of the surface over the day
  std::vector<double> node_k;  ///< temperature of every node at the start of the day
};

/// Finds the balanced start by repeating a day. The mean over the day of a periodic temperature is
/// linear in every layer (the steady profile), so that the profile is that of the surface's mean,
/// and what the day adds to it. The day is repeated until the mean at its end is the one that was
/// assumed. `run_day` advances the solver over one day and returns the mean temperature of the
/// surface; `guess_k` is where the search begins. It allocates.
[[nodiscard]] BalancedStart balanced_start(LayerSolver& solver, std::span<const SolidLayer> layers,
                                           double base_k, double guess_k, double start_s,
                                           const std::function<double()>& run_day);

}  // namespace emit::reference
