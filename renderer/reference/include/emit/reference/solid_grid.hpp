// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

namespace emit::reference {

/// Wanted cell length: `size_m` between low_m and high_m, growing with the distance outside.
struct SizeWish {
  double low_m = 0.0;
  double high_m = 0.0;
  double size_m = 0.0;
};

/// How the lines of one axis are spread.
struct GradedLines {
  std::vector<double> fixed_m;   ///< places where a line must be, any order; the ends included
  std::vector<SizeWish> wishes;  ///< the smallest wish holds
  double growth_frac = 0.2;      ///< growth of the wanted length per length of distance
  double max_size_m = 1e9;
  double refine = 1.0;  ///< multiplies the number of cells everywhere
};

/// Lines whose spacing follows the wishes as a smooth function of place between the fixed ones:
/// halving all wishes halves every cell, which second order needs. Fixed places closer together
/// than `merge_m` become one. @pre at least two fixed places further apart than that.
[[nodiscard]] std::vector<double> graded_lines(const GradedLines& wanted, double merge_m = 1e-9);

}  // namespace emit::reference
