// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <type_traits>

#include "emit/physics/lanes.hpp"

/// Equilibrium surface temperature: the positive root of
///
///   e T^4 + G T = A,      e = emissivity * sigma,  G = lambda/d + h_c,
///                         A = E_abs + lambda/d T_core + h_c T_air        (physics.md eq. 4)
///
/// The printed closed form (Ferrari) loses up to hundreds of kelvin in float32. This solver starts
/// from a rational approximation (relative error <= 3.5e-3 for every ratio of conduction to
/// radiation), takes one Halley step (4.8e-8) and then polishes in kelvin. It needs neither pow nor
/// a cube root.
/// The solver is header only, so that float, double and lanes (lanes.hpp) run the same source.
/// shaders/lib/equilibrium.glsl is the float32 twin. Any thread. RT-safe.
namespace emit::physics {

/// Coefficients of one surface balance, as raw SI values because this is the inner loop.
template <class Real>
struct SurfaceBalance {
  Real emission_w_m2_k4 = 0;    ///< e, >= 0
  Real conductance_w_m2_k = 0;  ///< G, >= 0
  Real source_w_m2 = 0;         ///< A; a positive root exists only if it is positive
};

/// Solution of one surface balance.
template <class Real>
struct EquilibriumResult {
  Real temperature_k = 0;
  /// An input was below its guard; the temperature is that of the guard.
  Mask<Real> clamped = Mask<Real>(false);
};

/// Smallest emission coefficient that the solver takes. It clamps a smaller one and reports it.
template <class Real>
inline constexpr Real kMinEmissionWPerM2K4 = std::is_same_v<Real, float> ? Real(1e-12)
                                                                         : Real(1e-30);
/// Smallest source that the solver takes, W m-2. It clamps a smaller one and reports it.
template <class Real>
inline constexpr Real kMinSourceWPerM2 = Real(1e-9);

/// Solves the balance for its positive root, physics.md eq. 4.
/// Accuracy in float: 0.2 mK over lambda 0.02..400 W/m/K, d 1e-4..1 m, emissivity 0.02..1,
/// radiative temperature 0..1000 K and core 200..400 K. Accuracy in double: 1e-14 relative
/// everywhere. A NaN input gives NaN.
template <class Real>
[[nodiscard]] EquilibriumResult<Real> solve_equilibrium(const SurfaceBalance<Real>& b) noexcept {
  using std::sqrt;
  EquilibriumResult<Real> result;
  const Real g = b.conductance_w_m2_k;
  const Real least_e = kMinEmissionWPerM2K4<Scalar<Real>>;
  const Real least_a = kMinSourceWPerM2<Scalar<Real>>;
  const Mask<Real> small_e = b.emission_w_m2_k4 < least_e;
  const Mask<Real> small_a = b.source_w_m2 < least_a;
  const Real e = choose(small_e, least_e, b.emission_w_m2_k4);
  const Real a = choose(small_a, least_a, b.source_w_m2);
  result.clamped = either(small_e, small_a);

  // Scale the unknown: T = r x, where x solves x^4 + k x = 1 and lies in (0, 1].
  const Real r = sqrt(sqrt(a / e));
  const Real k = g * r / a;
  // Start from a minimax fit over all k >= 0. Beyond 1e6 radiation is below rounding, and k^3 could
  // overflow.
  const Real c0 = Scalar<Real>(0.27628703);
  const Real c1 = Scalar<Real>(0.36899182);
  const Real c2 = Scalar<Real>(0.57870529);
  const Real c3 = Scalar<Real>(0.32065439);
  const Mask<Real> far = k > Real(1e6);
  Real x = choose(far, Real(1), Real(1) + k * (c0 + k * c1)) /
           choose(far, k, Real(1) + k * (c2 + k * (c3 + k * c1)));
  // Take one Halley step on x^4 + k x - 1.
  const Real f = x * x * x * x + k * x - Real(1);
  const Real f1 = Real(4) * x * x * x + k;
  x -= f * f1 / (f1 * f1 - Real(6) * x * x * f);

  Real t = r * x;
  // Polish in kelvin: Newton on the balance itself removes the rounding of r and k.
  constexpr int polish_steps = std::is_same_v<Scalar<Real>, float> ? 1 : 2;
  for (int i = 0; i < polish_steps; ++i) {
    const Real t3 = t * t * t;
    t -= ((e * t3 + g) * t - a) / (Real(4) * e * t3 + g);
  }
  result.temperature_k = t;
  return result;
}

}  // namespace emit::physics
