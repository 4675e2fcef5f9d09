// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>

#include "emit/physics/constants.hpp"
#include "emit/physics/lanes.hpp"

/// Latent heat of surfaces that give water to the air (physics.md section 8, eq. 47 to 50). Raw SI
/// numbers. Any thread. RT-safe. shaders/lib/evaporation.glsl is the float32 twin of saturation()
/// and add_moisture().
namespace emit::physics {

template <class Real>
struct FosterDrive;

/// Saturation pressure of water vapour and its slope.
template <class Real>
struct Saturation {
  Real pressure_pa = 0;
  Real slope_pa_k = 0;
};

/// Returns the saturation pressure over water from 273.15 K on and over ice below (physics.md eq.
/// 48: Tetens' formula with the numbers of Murray 1967; over water it is FAO-56 eq. 11). Valid for
/// 243 to 333 K, within 0.3 % over water and 1 % over ice. Outside 180 to 400 K it goes on along
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
/// Returns the saturation pressure over water at any temperature, Pa: that to which a relative
/// humidity refers (WMO). It is the form of saturation() over water.
[[nodiscard]] double saturation_over_water_pa(double temperature_k) noexcept;

/// Moisture of the air and what turns it into heat.
struct MoistAir {
  double vapour_pa = 0.0;            ///< vapour pressure e_a
  double psychrometric_pa_k = 66.5;  ///< gamma = c_p p / (0.622 lambda), > 0
  double heat_j_m3_k = 1200.0;       ///< rho c_p, > 0
};
/// Returns the moist air of a temperature, a pressure and a vapour pressure. The heat of
/// vaporisation is 2.501 MJ/kg less 2361 J/kg for every kelvin above 0 C (FAO-56 eq. 3-1), also
/// where the surface is frozen: sublimation takes 13 % more. c_p is 1013 J kg-1 K-1 (FAO-56).
[[nodiscard]] MoistAir moist_air(double air_k, double pressure_pa, double vapour_pa) noexcept;
/// Returns the moist air between `a` (f = 0) and `b` (f = 1), linear in f.
[[nodiscard]] MoistAir between_airs(const MoistAir& a, const MoistAir& b, double f) noexcept;

/// Wetness and resistances with which a surface gives water to the air. A wetness of 0 is a dry
/// surface.
struct MoistSurface {
  double wetness_frac = 0.0;    ///< share of the rate of a surface that is moist all over, 0..1
  double resistance_s_m = 0.0;  ///< between the water and the air at the surface, in sunlight
  double night_resistance_s_m = 0.0;  ///< the same without sunlight; not below resistance_s_m

  [[nodiscard]] bool dry() const noexcept { return !(wetness_frac > 0.0); }
  bool operator==(const MoistSurface&) const = default;
};

/// Short-wave irradiance on the face from which on stomata are open, W m-2 (Noilhan and Planton
/// 1989: the limit for crops).
inline constexpr double kOpenStomataWM2 = 100.0;

/// Returns the resistance of a surface under a short-wave irradiance, s m-1. Its inverse is linear
/// from that of the night to that of the day, which counts from kOpenStomataWM2 on.
[[nodiscard]] double surface_resistance_s_m(const MoistSurface& surface,
                                            double shortwave_w_m2) noexcept;

/// Returns k of q_e = k (e_s(T) - e_a), W m-2 Pa-1 (physics.md eq. 47), for the film of a face and
/// a resistance of the surface.
[[nodiscard]] constexpr double evaporation_w_m2_pa(double film_w_m2_k, double wetness_frac,
                                                   double resistance_s_m,
                                                   const MoistAir& air) noexcept {
  return wetness_frac * film_w_m2_k /
         (air.psychrometric_pa_k * (1.0 + film_w_m2_k * resistance_s_m / air.heat_j_m3_k));
}

/// Gives the drive of a surface what it exchanges with the moisture of the air. The film of the
/// drive must be that of the air alone. Dew forms without the resistance of the surface, on all of
/// it. A dry surface keeps its drive.
void add_moisture(const MoistSurface& surface, const MoistAir& air, double shortwave_w_m2,
                  FosterDrive<double>& drive) noexcept;

}  // namespace emit::physics
