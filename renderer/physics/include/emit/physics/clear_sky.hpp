// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/physics/sun.hpp"
#include "emit/physics/units.hpp"

/// Models of sun, sky and air for a place without weather data (physics.md section 8).
/// Any thread. RT-safe. Raw SI numbers: these are the inputs of Eq. 1.
namespace emit::physics {

/// Relative optical air mass of Kasten and Young (1989), sea level; 0 with the sun below -2 deg.
[[nodiscard]] double relative_air_mass(Radians elevation) noexcept;

/// Pressure ratio to sea level in the standard atmosphere, height in -500..11000 m.
[[nodiscard]] double pressure_ratio(Metres height) noexcept;

struct SolarIrradiance {
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
};

/// Clear-sky irradiance after Ineichen and Perez (2002) with Linke turbidity (2 very clear .. 7
/// hazy). The extraterrestrial irradiance follows the distance of the sun. Zero at night.
[[nodiscard]] SolarIrradiance clear_sky_irradiance(const SunPosition& sun, Metres height,
                                                   double linke_turbidity) noexcept;

/// Emissivity of the sky: Berdahl-Martin form as recalibrated by Li et al. (2017), plus the cloud
/// term 0.784 (1 - e) n. `cloud_frac` n in 0..1; dew point 230..310 K. Never above 1.
[[nodiscard]] double sky_emissivity_frac(Kelvin dew_point, double cloud_frac) noexcept;

/// Long-wave irradiance from the whole sky on a horizontal face, e_sky sigma T_air^4.
[[nodiscard]] double sky_longwave_w_m2(Kelvin air, Kelvin dew_point, double cloud_frac) noexcept;

/// Air temperature: mean + amplitude cos(2 pi (t - 15 h) / 24 h), t mean local solar time.
[[nodiscard]] Kelvin daily_air_temperature(double solar_hours, Kelvin mean,
                                           Kelvin amplitude) noexcept;

/// McAdams: h_c = 5.7 + 3.8 V, W m-2 K-1.
[[nodiscard]] double film_coefficient_w_m2_k(double wind_m_s) noexcept;

}  // namespace emit::physics
