// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

namespace emit::physics {

/// Solves min |A x - b| subject to x >= 0 for small dense systems, after Lawson and Hanson (1974,
/// ch. 23). `matrix` is A in row-major order, of rhs.size() rows and `columns` columns; the result
/// has `columns` values. Setup only.
/// @pre matrix.size() is rhs.size() * columns.
[[nodiscard]] std::vector<double> solve_nnls(std::span<const double> matrix,
                                             std::span<const double> rhs, std::size_t columns);

}  // namespace emit::physics
