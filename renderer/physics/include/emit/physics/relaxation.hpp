// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>

#include "emit/physics/check.hpp"

/// Relaxation of a surface towards its equilibrium temperature as a sum of exponentials:
///
///   T(t) = sum w_i x_i(t),   tau_i x_i' = u(t) - x_i,   sum w_i = 1        (physics.md eq. 5)
///
/// One step of length dt (physics.md eq. 6) is exact for a drive u that is constant or linear over
/// it, whatever dt is. The gains are computed here in double, once per mode and step. The state
/// itself may be float32 if it is stored as an offset from a reference temperature; a state in
/// kelvin stalls in float32. shaders/lib/relaxation.glsl is the float32 twin. Any thread. RT-safe.
namespace emit::physics {

/// Gains of one step of one mode, physics.md eq. 6: x_new = x + (u0 - x) start + (u1 - x) end. With
/// z = dt/tau, E = exp(-z) and phi = (1-E)/z they are start = phi - E and end = 1 - phi. The step
/// is written as an increment, so nothing cancels for small z.
template <class Real>
struct RelaxationGains {
  Real start_frac = 0;  ///< weight of the drive at the start of the step
  Real end_frac = 0;    ///< weight of the drive at the end of the step
};

/// Returns the gains of one step, physics.md eq. 6. An infinite dt_s gives (0, 1).
/// @pre dt_s >= 0 and tau_s > 0.
[[nodiscard]] inline RelaxationGains<double> relaxation_gains(double dt_s, double tau_s) noexcept {
  EMIT_DCHECK_OP(dt_s, >=, 0.0);
  EMIT_DCHECK_OP(tau_s, >, 0.0);
  const double z = dt_s / tau_s;
  if (z == 0.0) {
    return {0.0, 0.0};
  }
  if (std::isinf(z)) {
    return {0.0, 1.0};
  }
  const double total = -std::expm1(-z);  // 1 - E
  double end = 0.0;
  if (z < 0.5) {
    // Sum the series 1 - phi = z/2 - z^2/6 + z^3/24 - ...; the closed form loses eps/z here.
    double term = z / 2.0;
    end = term;
    for (int n = 3; n < 20; ++n) {
      term *= -z / n;
      end += term;
    }
  } else {
    end = 1.0 - total / z;
  }
  return {total - end, end};
}

/// Returns the state after one step whose drive is linear from u0 to u1.
template <class Real>
[[nodiscard]] constexpr Real relax_linear(Real x, Real u0, Real u1,
                                          const RelaxationGains<Real>& g) noexcept {
  return x + ((u0 - x) * g.start_frac + (u1 - x) * g.end_frac);
}

/// Returns the state after one step of constant drive u. The sum of both gains is 1 - E.
template <class Real>
[[nodiscard]] constexpr Real relax_constant(Real x, Real u,
                                            const RelaxationGains<Real>& g) noexcept {
  return x + (u - x) * (g.start_frac + g.end_frac);
}

}  // namespace emit::physics
