// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"

/// Heat that spreads sideways from a lit patch, computed by SolidSolver. It is the model of `emit
/// evaluate conduction-lateral`.
namespace emit::reference {

/// Shape of the lit patch.
enum class LitPatch : std::uint8_t {
  half_plane,         ///< x > 0
  moving_half_plane,  ///< x > v t
  strip,              ///< |x| < half_x
  rectangle           ///< |x| < half_x, |y| < half_y
};

/// A semi-infinite solid at rest. From t = 0 on its face z = 0 takes `flux_w_m2` over a patch; the
/// rest of the face is adiabatic.
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

/// Returns the rise of temperature at the point and time of the case, K. `refine` multiplies the
/// cells per axis and the number of steps, 0.25..16. Errors: invalid_argument (a value is out of
/// range).
[[nodiscard]] physics::Result<double> lateral_rise_k(const LateralCase& c, double refine);

/// Computes many cases, spread over the cores. The result of a case that is not valid is NaN.
[[nodiscard]] std::vector<double> lateral_rises_k(std::span<const LateralCase> cases,
                                                  double refine);

}  // namespace emit::reference
