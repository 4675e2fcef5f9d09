// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/geodesy.hpp"

/// Attitude of the earth and the step from the ecliptic to an observer on the ground, for the
/// positions of sun and moon. RT-safe.
namespace emit::physics {

inline constexpr double kArcsec = kDegree / 3600.0;
inline constexpr double kAstronomicalUnitM = 149597870700.0;
inline constexpr double kJ2000 = 2451545.0;
inline constexpr double kPosixEpochJd = 2440587.5;

/// Instant split for precision.
struct JulianDate {
  double day = 0.0;
  double fraction = 0.0;
};
/// Returns the date of a POSIX time, and its decimal year.
[[nodiscard]] JulianDate julian_date(std::int64_t posix_utc_ns) noexcept;
[[nodiscard]] double decimal_year(std::int64_t posix_utc_ns) noexcept;

/// Turn of the earth at an instant, equinox of date.
struct EarthAttitude {
  double centuries = 0.0;     ///< of terrestrial time since J2000
  double nutation_rad = 0.0;  ///< in longitude
  double obliquity_rad = 0.0;
  double sidereal_rad = 0.0;  ///< Greenwich apparent sidereal time
};
[[nodiscard]] EarthAttitude earth_attitude(const JulianDate& ut1, double tt_minus_ut1_s) noexcept;

/// Turns an ecliptic vector of date into the earth-fixed frame.
[[nodiscard]] glm::dvec3 ecef_from_ecliptic(const EarthAttitude& earth,
                                            const glm::dvec3& ecliptic) noexcept;
/// Unit vector of an ecliptic longitude and latitude.
[[nodiscard]] glm::dvec3 ecliptic_direction(double longitude_rad, double latitude_rad) noexcept;

/// The angle in [0, 2 pi).
[[nodiscard]] double wrapped_turn(double angle_rad) noexcept;

/// Apparent geocentric place of the sun.
struct SunEcliptic {
  double longitude_rad = 0.0;  ///< with nutation and aberration
  double latitude_rad = 0.0;
  double distance_au = 1.0;
};
[[nodiscard]] SunEcliptic sun_ecliptic(const EarthAttitude& earth) noexcept;

}  // namespace emit::physics
