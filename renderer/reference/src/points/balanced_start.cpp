// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/balanced_start.hpp"

#include <cmath>
#include <cstddef>

namespace emit::reference {

BalancedStart balanced_start(LayerSolver& solver, std::span<const SolidLayer> layers, double base_k,
                             double guess_k, double start_s,
                             const std::function<double()>& run_day) {
  constexpr int kMostDays = 30;
  constexpr double kSameK = 0.01;
  const std::size_t nodes = solver.mesh().nodes();
  BalancedStart out{guess_k, std::vector<double>(nodes)};
  std::vector<double> steady_k(nodes);
  const auto find_steady = [&] {
    solver.start(steady_profile(layers, out.mean_k, base_k), start_s);
    solver.copy_nodes_k(steady_k);
  };
  find_steady();
  out.node_k = steady_k;
  for (int day = 0; day < kMostDays; ++day) {
    solver.start_nodes(out.node_k, start_s);
    const double mean_k = run_day();
    // Keep what the day adds to the steady profile, and take the profile of the mean that it had.
    solver.copy_nodes_k(out.node_k);
    for (std::size_t i = 0; i < nodes; ++i) out.node_k[i] -= steady_k[i];
    const double moved_k = std::abs(mean_k - out.mean_k);
    out.mean_k = mean_k;
    find_steady();
    for (std::size_t i = 0; i < nodes; ++i) out.node_k[i] += steady_k[i];
    if (moved_k < kSameK) break;
  }
  return out;
}

}  // namespace emit::reference
