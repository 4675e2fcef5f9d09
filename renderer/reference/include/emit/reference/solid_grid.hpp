// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

namespace emit::reference {

/// Wanted cell length along an axis. It is `size_m` between low_m and high_m and grows with the
/// distance outside.
struct SizeWish {
  double low_m = 0.0;
  double high_m = 0.0;
  double size_m = 0.0;
};

/// Rules by which the grid lines of one axis are spread.
struct GradedLines {
  std::vector<double> fixed_m;   ///< places that must have a line, in any order, both ends included
  std::vector<SizeWish> wishes;  ///< the smallest wanted length counts
  double growth_frac = 0.2;      ///< growth of the wanted length per distance
  double max_size_m = 1e9;
  double refine = 1.0;  ///< multiplies the number of cells everywhere
};

/// Returns grid lines whose spacing follows the wanted lengths as a smooth function of place
/// between the fixed lines. Half the wanted lengths give half of every cell, which second order
/// needs. Fixed places closer together than `merge_m` become one.
/// @pre at least two fixed places are further apart than merge_m.
[[nodiscard]] std::vector<double> graded_lines(const GradedLines& wanted, double merge_m = 1e-9);

}  // namespace emit::reference
