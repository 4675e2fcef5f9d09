// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"

/// Heat that spreads sideways from a lit patch, by SolidSolver: the model behind
/// `emit evaluate conduction-lateral`.
namespace emit::reference {

enum class LitPatch : std::uint8_t {
  half_plane,         ///< x > 0
  moving_half_plane,  ///< x > v t
  strip,              ///< |x| < half_x
  rectangle           ///< |x| < half_x, |y| < half_y
};

/// A semi-infinite solid at rest whose face z = 0 takes `flux_w_m2` over a patch from t = 0 on and
/// is adiabatic elsewhere.
struct LateralCase {
  LitPatch patch = LitPatch::half_plane;
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;
  double flux_w_m2 = 0.0;
  double half_x_m = 0.0;
  double half_y_m = 0.0;
  double speed_m_s = 0.0;
  double x_m = 0.0;
  double y_m = 0.0;
  double depth_m = 0.0;
  double time_s = 0.0;
};

/// Rise of temperature at the case's point and time, K. `refine` multiplies the cells per axis and
/// the steps. Errors: invalid_argument (values outside their range).
[[nodiscard]] physics::Result<double> lateral_rise_k(const LateralCase& c, double refine);

/// Many cases, spread over the cores. NaN where a case is not valid.
[[nodiscard]] std::vector<double> lateral_rises_k(std::span<const LateralCase> cases,
                                                  double refine);

}  // namespace emit::reference
