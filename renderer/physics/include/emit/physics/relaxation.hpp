// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>

/// Relaxation of a surface towards its equilibrium temperature, a sum of exponentials:
///
///   T(t) = sum w_i x_i(t),   tau_i x_i' = u(t) - x_i,   sum w_i = 1        (physics.md eq. 5)
///
/// One step of length dt (eq. 6) is exact for a drive u that is constant or linear over it,
/// whatever dt. The gains are computed here in double once per (mode, step); the state itself may
/// be float32 if it is stored as an offset from a reference temperature (a kelvin state stalls in
/// float32). shaders/lib/relaxation.glsl is the float32 twin. Any thread. RT-safe.
namespace emit::physics {

/// x_new = x + (u0 - x) start + (u1 - x) end, with z = dt/tau, E = exp(-z), phi = (1-E)/z:
/// start = phi - E, end = 1 - phi. Written as increments, so nothing cancels for small z.
template <class Real>
struct RelaxationGains {
  Real start_frac = 0;  ///< weight of the drive at the start of the step
  Real end_frac = 0;    ///< weight of the drive at the end of the step
};

/// Gains of one step. @pre dt_s >= 0, tau_s > 0; an infinite dt_s gives (0, 1).
[[nodiscard]] inline RelaxationGains<double> relaxation_gains(double dt_s, double tau_s) noexcept {
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
    // 1 - phi = z/2 - z^2/6 + z^3/24 - ...; the closed form loses eps/z here.
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

/// Linear drive from u0 to u1.
template <class Real>
[[nodiscard]] constexpr Real relax_linear(Real x, Real u0, Real u1,
                                          const RelaxationGains<Real>& g) noexcept {
  return x + ((u0 - x) * g.start_frac + (u1 - x) * g.end_frac);
}

/// Constant drive u: 1 - E is the sum of both gains.
template <class Real>
[[nodiscard]] constexpr Real relax_constant(Real x, Real u,
                                            const RelaxationGains<Real>& g) noexcept {
  return x + (u - x) * (g.start_frac + g.end_frac);
}

}  // namespace emit::physics
