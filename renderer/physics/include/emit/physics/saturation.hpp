// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>

#include "emit/physics/constants.hpp"
#include "emit/physics/lanes.hpp"

/// Saturation of air with water (physics.md eq. 48). The function is a template on float, double
/// and lanes (lanes.hpp); shaders/lib/evaporation.glsl is the float32 twin. Any thread. RT-safe.
namespace emit::physics {

/// Saturation pressure of water vapour and its slope.
template <class Real>
struct Saturation {
  Real pressure_pa = 0;
  Real slope_pa_k = 0;
};

/// Returns the saturation pressure over water from 273.15 K on and over ice below (physics.md eq.
/// 48: Tetens' formula with the numbers of Murray 1967; over water it is FAO-56 eq. 11). Valid for
/// 223 to 333 K, within 0.3 % over water and 0.5 % over ice. Outside 180 to 400 K it goes on along
/// its tangent, so that it stays finite and rises.
template <class Real>
[[nodiscard]] Saturation<Real> saturation(const Real& temperature_k) noexcept {
  using std::exp;
  const Real low = Scalar<Real>(180);
  const Real high = Scalar<Real>(400);
  const Real floored = choose(Mask<Real>(temperature_k < low), low, temperature_k);
  const Real held_k = choose(Mask<Real>(floored > high), high, floored);
  const Real celsius = held_k - Real(Scalar<Real>(kZeroCelsiusK));
  const Mask<Real> frozen = celsius < Real(0);
  const Real a = choose(frozen, Real(Scalar<Real>(21.875)), Real(Scalar<Real>(17.27)));
  const Real b = choose(frozen, Real(Scalar<Real>(265.5)), Real(Scalar<Real>(237.3)));
  const Real above = celsius + b;
  const Real pressure_pa = Real(Scalar<Real>(610.8)) * exp(a * celsius / above);
  const Real slope_pa_k = pressure_pa * a * b / (above * above);
  return {pressure_pa + slope_pa_k * (temperature_k - held_k), slope_pa_k};
}

}  // namespace emit::physics
