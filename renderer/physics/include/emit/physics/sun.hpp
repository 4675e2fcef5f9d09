// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/units.hpp"

/// Where the sun stands. Truncated VSOP87 for the earth, principal nutation terms, annual
/// aberration, and the parallax of an observer on the WGS-84 ellipsoid; no refraction.
/// Error against IAU 2006/2000A: below 0.0005 deg in the tests (2000..2035), well below 0.01 deg
/// for 1950..2050, given UT1. UTC taken for UT1 adds at most 0.004 deg (physics.md section 7). Any
/// thread. RT-safe: no allocation, a few microseconds.
namespace emit::physics {

/// A geodetic place, WGS-84.
struct GeoPlace {
  Radians latitude;   ///< north positive
  Radians longitude;  ///< east positive
  Metres height;      ///< above the ellipsoid
};

struct SunPosition {
  glm::dvec3 direction_enu{0.0, 0.0, 1.0};  ///< unit vector from the place to the sun's centre
  Radians azimuth;                          ///< from north through east, [0, 2 pi)
  Radians elevation;                        ///< topocentric, airless
  double distance_au = 1.0;                 ///< from the place
};

/// At an instant given as POSIX time (ns since 1970-01-01 UTC, no leap seconds). TT-UT1 comes from
/// delta_t_s().
[[nodiscard]] SunPosition sun_position(std::int64_t posix_utc_ns, const GeoPlace& place) noexcept;

/// At a Julian date in UT1, split in two for precision (their sum counts), with TT - UT1 given.
[[nodiscard]] SunPosition sun_position_ut1(double julian_day, double day_fraction,
                                           double tt_minus_ut1_s, const GeoPlace& place) noexcept;

/// Approximate TT - UT1 in seconds for a year between 1900 and 2150 (polynomials of Espenak and
/// Meeus; since 2005 a straight line to 69.2 s in 2020, held to 2030). Ten seconds move the sun by
/// 1e-4 deg.
[[nodiscard]] double delta_t_s(double decimal_year) noexcept;

/// Julian date of 0h UT on a day of the Gregorian calendar.
[[nodiscard]] double julian_day_0h(int year, int month, int day) noexcept;

/// Mean local solar time, hours in [0, 24); 12 when the mean sun culminates.
[[nodiscard]] double mean_solar_hours(std::int64_t posix_utc_ns, Radians longitude) noexcept;

}  // namespace emit::physics
