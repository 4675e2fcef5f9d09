// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

namespace emit::physics {

/// Least squares with x >= 0 for small dense systems, after Lawson and Hanson (1974, ch. 23).
/// `matrix` is row-major, rows.size() = rhs.size() * columns. Setup only.
[[nodiscard]] std::vector<double> solve_nnls(std::span<const double> matrix,
                                             std::span<const double> rhs, std::size_t columns);

}  // namespace emit::physics
