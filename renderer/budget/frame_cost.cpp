// SPDX-License-Identifier: Apache-2.0
#include "budget/frame_cost.hpp"

#include <algorithm>

#include "emit/physics/nnls.hpp"

namespace emit::renderer {
namespace {

/// Triangles and pixels come by the hundred thousand: columns of like size.
constexpr double kUnit = 1e5;
/// Below, it is the clock that is measured.
constexpr double kLeastMs = 1e-3;

}  // namespace

void FrameCost::add(double triangles, double pixels, double frame_ms) {
  const double weight = 1.0 / std::max(frame_ms, kLeastMs);
  rows_.insert(rows_.end(), {weight, weight * triangles / kUnit, weight * pixels / kUnit});
}

void FrameCost::fit() {
  constexpr std::size_t kColumns = 3;
  if (rows_.empty()) return;
  const std::vector<double> ones(rows_.size() / kColumns, 1.0);
  const std::vector<double> x = physics::solve_nnls(rows_, ones, kColumns);
  constant_ms_ = x[0];
  ms_per_triangle_ = x[1] / kUnit;
  ms_per_pixel_ = x[2] / kUnit;
}

}  // namespace emit::renderer
