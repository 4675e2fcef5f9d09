// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "emit/physics/sun.hpp"
#include "emit/physics/units.hpp"

/// Models of sun, sky and air for a place without weather data (physics.md section 8). They give
/// the inputs of physics.md eq. 1 as raw SI numbers. Any thread. RT-safe.
namespace emit::physics {

/// Returns the relative optical air mass at sea level after Kasten and Young (1989), physics.md eq.
/// 10. It is 0 when the sun stands below -2 deg.
[[nodiscard]] double relative_air_mass(Radians elevation) noexcept;

/// Returns the ratio of the air pressure at a height to that at sea level, in the standard
/// atmosphere. The height is clamped to -500..11000 m.
[[nodiscard]] double pressure_ratio(Metres height) noexcept;

/// Irradiance of the sun and of the sky on level ground, W m-2.
struct SolarIrradiance {
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
};

/// Returns the clear-sky irradiance after Ineichen and Perez (2002), physics.md eq. 11.
/// `linke_turbidity` is 2 (very clear) to 7 (hazy). The extraterrestrial irradiance follows the
/// distance of the sun. The result is zero when the sun is below the horizon.
[[nodiscard]] SolarIrradiance clear_sky_irradiance(const SunPosition& sun, Metres height,
                                                   double linke_turbidity) noexcept;

/// Returns the share of the clear-sky beam that the direct sun has, 0..1.2: `direct_normal_w_m2`,
/// as measured or modelled below the clouds, over the beam of clear_sky_irradiance(). It is 0 where
/// that beam is below 1 W m-2.
[[nodiscard]] double beam_share_frac(double direct_normal_w_m2, const SunPosition& sun,
                                     Metres height, double linke_turbidity) noexcept;

/// Returns the elevation at which the air's refraction shows the sun, after Saemundsson (1986), for
/// an airless elevation; below -1 deg it is the airless one.
[[nodiscard]] Radians apparent_elevation(Radians airless) noexcept;

/// Base of the clouds. Without a height and a temperature it is as warm as eq. 12 was fitted with:
/// 0.941 of the air's temperature.
struct CloudBase {
  std::optional<double> height_m = std::nullopt;  ///< above the ground, 0..12000
  std::optional<double> kelvin = std::nullopt;    ///< if absent, that of air that cools by 6.5 K/km
};
/// Returns the temperature of the clouds' base above air of `air_k` at the ground, K.
[[nodiscard]] double cloud_base_k(const CloudBase& base, double air_k) noexcept;
/// Returns the height of the clouds' base above the ground, m: as stated, or where air that cools
/// by 6.5 K/km has its temperature.
[[nodiscard]] double cloud_base_m(const CloudBase& base, double air_k) noexcept;

/// Clouds whose base follows from an irradiance are at least that high above the ground, so that a
/// camera that stands on it is below them.
inline constexpr double kLowestInferredBaseM = 100.0;
/// No base is colder, unless its temperature is stated.
inline constexpr double kColdestCloudK = 200.0;

/// Returns the emissivity of the sky, at most 1, physics.md eq. 12: the Berdahl-Martin form as
/// recalibrated by Li et al. (2017), plus the cloud term 0.784 (1 - e) n, for clouds with a base of
/// 0.941 times the air's temperature. `cloud_frac` is n and is clamped to 0..1. The dew point
/// should lie in 230..310 K.
[[nodiscard]] double sky_emissivity_frac(Kelvin dew_point, double cloud_frac) noexcept;

/// Returns the long-wave irradiance of the whole sky on a horizontal face, W m-2: e_sky sigma
/// T_air^4, where the clouds' 0.784 is the fourth power of their base's temperature by the air's.
[[nodiscard]] double sky_longwave_w_m2(Kelvin air, Kelvin dew_point, double cloud_frac,
                                       const CloudBase& base = {}) noexcept;

/// Returns the air temperature mean + amplitude cos(2 pi (t - 15 h) / 24 h), physics.md eq. 13.
/// `solar_hours` is t, the mean local solar time in hours.
[[nodiscard]] Kelvin daily_air_temperature(double solar_hours, Kelvin mean,
                                           Kelvin amplitude) noexcept;

/// Returns the film coefficient h_c = 5.7 + 3.8 V of McAdams (1954), W m-2 K-1, physics.md eq. 13.
/// A negative wind speed counts as 0.
[[nodiscard]] double film_coefficient_w_m2_k(double wind_m_s) noexcept;

}  // namespace emit::physics
