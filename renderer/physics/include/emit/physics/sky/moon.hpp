// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/geodesy.hpp"
#include "emit/physics/units.hpp"

/// Position and heat of the moon (physics.md section 15). The position has the leading terms of
/// ELP-2000/82 (Chapront; Meeus, Astronomical Algorithms, chapter 47) and the parallax of an
/// observer on the WGS-84 ellipsoid. It has no refraction. Error: below 0.01 deg for 1950..2050.
/// Any thread. RT-safe: no allocation, some microseconds.
namespace emit::physics {

inline constexpr double kMoonRadiusM = 1737.4e3;
/// Temperature of the moon's ground with the sun in the zenith, at 1 au from the sun (Vasavada et
/// al. 2012, Diviner: 387 to 397 K).
inline constexpr double kMoonSubsolarK = 394.0;
/// Emissivity of the moon's ground in all bands; reflects the rest (regolith in 2 to 14 um: 0.8 to
/// 0.98).
inline constexpr double kMoonEmissivityFrac = 0.95;

/// Geocentric place of the moon, ecliptic and mean equinox of date.
struct MoonEcliptic {
  double longitude_rad = 0.0;
  double latitude_rad = 0.0;
  double distance_m = 0.0;  ///< between the centres
};
/// @param tt_centuries  Julian centuries of terrestrial time since J2000
[[nodiscard]] MoonEcliptic moon_ecliptic(double tt_centuries) noexcept;

/// The moon seen from a place.
struct MoonPosition {
  glm::dvec3 direction_enu{0.0, 0.0, 1.0};  ///< unit vector from the place to the moon's centre
  glm::dvec3 to_sun_enu{0.0, 0.0, 1.0};     ///< unit vector from the moon to the sun, same axes
  double distance_m = 3.844e8;              ///< from the place to the moon's centre
  double sun_au = 1.0;                      ///< from the moon to the sun
};
/// Returns the position at an instant given as POSIX time (ns since 1970-01-01 UTC).
[[nodiscard]] MoonPosition moon_position(std::int64_t posix_utc_ns, const GeoPlace& place) noexcept;

/// Temperature of the moon's ground where the sun stands at an angle from the zenith: that of a
/// surface without memory, K. By night it is 100 K.
/// @param cosine  of that angle, negative by night
[[nodiscard]] double moon_temperature_k(double cosine, double sun_au) noexcept;

}  // namespace emit::physics
