// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/geodesy.hpp"
#include "emit/physics/units.hpp"

/// Position of the sun (physics.md section 7). The model has truncated VSOP87 for the earth, the
/// principal nutation terms, annual aberration, and the parallax of an observer on the WGS-84
/// ellipsoid. It has no refraction.
/// Error against IAU 2006/2000A, given UT1: below 0.0005 deg in the tests (2000..2035), well below
/// 0.01 deg for 1950..2050. UTC used in place of UT1 adds at most 0.004 deg. Any thread. RT-safe:
/// no allocation, a few microseconds.
namespace emit::physics {

/// Direction and distance of the sun, seen from a place.
struct SunPosition {
  glm::dvec3 direction_enu{0.0, 0.0, 1.0};  ///< unit vector from the place to the sun's centre
  Radians azimuth;                          ///< clockwise from north, [0, 2 pi)
  Radians elevation;                        ///< topocentric, airless
  double distance_au = 1.0;                 ///< distance from the place to the sun, au
};

/// Returns the sun's position at an instant given as POSIX time (ns since 1970-01-01 UTC, no leap
/// seconds). TT - UT1 comes from delta_t_s().
[[nodiscard]] SunPosition sun_position(std::int64_t posix_utc_ns, const GeoPlace& place) noexcept;

/// Returns the sun's position at a Julian date in UT1. The date is the sum of `julian_day` and
/// `day_fraction`, split for precision. TT - UT1 is given in seconds.
[[nodiscard]] SunPosition sun_position_ut1(double julian_day, double day_fraction,
                                           double tt_minus_ut1_s, const GeoPlace& place) noexcept;

/// Returns the approximate TT - UT1 in seconds for a year from 1900 to 2150. The polynomials are
/// those of Espenak and Meeus; from 2005 a straight line leads to 69.2 s in 2020, which is held
/// until 2030. An error of ten seconds moves the sun by 1e-4 deg.
[[nodiscard]] double delta_t_s(double decimal_year) noexcept;

/// Returns the Julian date of 0h UT on a day of the Gregorian calendar.
[[nodiscard]] double julian_day_0h(int year, int month, int day) noexcept;

/// Returns the mean local solar time in hours, [0, 24). It is 12 when the mean sun culminates.
[[nodiscard]] double mean_solar_hours(std::int64_t posix_utc_ns, Radians longitude) noexcept;

}  // namespace emit::physics
