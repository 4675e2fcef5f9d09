// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cmath>
#include <cstddef>

#include "emit/physics/constants.hpp"

namespace emit::physics {

/// Gauss-Legendre rule of N points on [-1, 1], symmetric. Any thread.
template <int N>
struct GaussRule {
  std::array<double, static_cast<std::size_t>(N)> node{};
  std::array<double, static_cast<std::size_t>(N)> weight{};
};

/// Returns the rule of N points. Newton's method on the Legendre polynomial finds its abscissae and
/// weights, so that no number is typed.
template <int N>
[[nodiscard]] GaussRule<N> gauss_legendre() noexcept {
  GaussRule<N> rule;
  for (int i = 0; i < N; ++i) {
    double z = std::cos(kPi * (i + 0.75) / (N + 0.5));
    double slope = 1.0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      // Evaluate the polynomial by its three-term recurrence, then its derivative.
      double p0 = 1.0;
      double p1 = z;
      for (int n = 2; n <= N; ++n) {
        const double p2 = ((2 * n - 1) * z * p1 - (n - 1) * p0) / n;
        p0 = p1;
        p1 = p2;
      }
      slope = N * (z * p1 - p0) / (z * z - 1.0);
      const double step = p1 / slope;
      z -= step;
      if (std::abs(step) < 1e-16) {
        break;
      }
    }
    const auto at = static_cast<std::size_t>(i);
    rule.node[at] = z;
    rule.weight[at] = 2.0 / ((1.0 - z * z) * slope * slope);
  }
  return rule;
}

}  // namespace emit::physics
