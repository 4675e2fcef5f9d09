// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/physics/foster.hpp"
#include "emit/physics/saturation.hpp"

/// Latent heat of surfaces that give water to the air (physics.md section 8, eq. 47 to 50). Raw SI
/// numbers. Any thread. RT-safe. shaders/lib/evaporation.glsl is the float32 twin of
/// add_moisture().
namespace emit::physics {

/// Returns the saturation pressure over water at any temperature, Pa: that to which a relative
/// humidity refers (WMO). It is the form of saturation() over water.
[[nodiscard]] double saturation_over_water_pa(double temperature_k) noexcept;

/// Returns the dew point of a vapour pressure: the inverse of saturation_over_water_pa().
/// @pre vapour_pa > 0
[[nodiscard]] double dew_point_k(double vapour_pa) noexcept;

/// Moisture of the air and what turns it into heat.
struct MoistAir {
  double vapour_pa = 0.0;            ///< vapour pressure e_a
  double psychrometric_pa_k = 66.5;  ///< gamma = c_p p / (0.622 lambda), > 0
  double heat_j_m3_k = 1200.0;       ///< rho c_p, > 0
};
/// Returns the heat of vaporisation of water, J kg-1: 2.501 MJ/kg less 2361 J/kg for every kelvin
/// above 0 C (FAO-56 eq. 3-1).
[[nodiscard]] constexpr double vaporisation_j_kg(double air_k) noexcept {
  return 2.501e6 - 2361.0 * (air_k - kZeroCelsiusK);
}
/// Returns the moist air of a temperature, a pressure and a vapour pressure. The heat of
/// vaporisation is vaporisation_j_kg(), also where the surface is frozen: sublimation takes 13 %
/// more. c_p is 1013 J kg-1 K-1 (FAO-56).
[[nodiscard]] MoistAir moist_air(double air_k, double pressure_pa, double vapour_pa) noexcept;
/// Returns the moist air between `a` (f = 0) and `b` (f = 1), linear in f.
[[nodiscard]] MoistAir between_airs(const MoistAir& a, const MoistAir& b, double f) noexcept;

/// Water that a surface gives to the air. A surface without wetness and film is dry.
struct MoistSurface {
  double wetness_frac = 0.0;    ///< share of the rate of a surface that is moist all over, 0..1
  double resistance_s_m = 0.0;  ///< between the water and the air at the surface, in sunlight
  double night_resistance_s_m = 0.0;  ///< the same without sunlight; not below resistance_s_m
  /// Share that rain has wetted, 0..1, which has no resistance (climate/surface_water.hpp). The
  /// rest is as above.
  double film_frac = 0.0;

  [[nodiscard]] bool dry() const noexcept { return !(wetness_frac > 0.0) && !(film_frac > 0.0); }
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
/// a resistance of the surface. `film_frac` is the share that rain has wetted (eq. 64).
[[nodiscard]] constexpr double evaporation_w_m2_pa(double film_w_m2_k, double wetness_frac,
                                                   double resistance_s_m, const MoistAir& air,
                                                   double film_frac = 0.0) noexcept {
  const double share = wetness_frac / (1.0 + film_w_m2_k * resistance_s_m / air.heat_j_m3_k);
  return (film_frac + (1.0 - film_frac) * share) * film_w_m2_k / air.psychrometric_pa_k;
}

/// Gives the drive of a surface what it exchanges with the moisture of the air. The film of the
/// drive must be that of the air alone. Dew forms without the resistance of the surface, on all of
/// it. A dry surface takes the vapour alone.
void add_moisture(const MoistSurface& surface, const MoistAir& air, double shortwave_w_m2,
                  FosterDrive<double>& drive) noexcept;

}  // namespace emit::physics
