// SPDX-License-Identifier: Apache-2.0
#include "budget/frame_cost.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/nnls.hpp"

namespace emit::renderer {
namespace {

/// Unit of triangles and pixels that gives the columns of the fit similar sizes.
constexpr double kUnit = 1e5;
/// Smallest time of a frame. Below it the clock is measured and not the frame.
constexpr double kMinMs = 1e-3;

}  // namespace

void FrameCost::add(double triangles, double pixels, double frame_ms) {
  EMIT_CHECK(std::isfinite(triangles) && triangles >= 0.0);
  EMIT_CHECK(std::isfinite(pixels) && pixels >= 0.0);
  EMIT_CHECK(std::isfinite(frame_ms) && frame_ms >= 0.0);
  // Divide the row by the time, so that the fit minimises relative errors.
  const double weight = 1.0 / std::max(frame_ms, kMinMs);
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
