// SPDX-License-Identifier: Apache-2.0
#include "celestial.hpp"

#include <cmath>
#include <cstdint>

namespace emit::physics {
namespace {

constexpr std::int64_t kNsPerDay = 86400LL * 1000000000LL;

struct Nutation {
  double longitude_rad;
  double obliquity_rad;
};

/// Sums the five largest terms of the IAU 1980 series; the rest adds up to under 0.3 arcseconds.
Nutation nutation(double centuries) noexcept {
  const double node = (125.04452 - 1934.136261 * centuries) * kDegree;
  const double sun = (280.4665 + 36000.7698 * centuries) * kDegree;
  const double moon = (218.3165 + 481267.8813 * centuries) * kDegree;
  const double sun_anomaly = (357.52772 + 35999.050340 * centuries) * kDegree;
  const double moon_anomaly = (134.96298 + 477198.867398 * centuries) * kDegree;
  return {(-17.1996 * std::sin(node) - 1.3187 * std::sin(2.0 * sun) -
           0.2274 * std::sin(2.0 * moon) + 0.2062 * std::sin(2.0 * node) +
           0.1426 * std::sin(sun_anomaly) + 0.0712 * std::sin(moon_anomaly)) *
              kArcsec,
          (9.2025 * std::cos(node) + 0.5736 * std::cos(2.0 * sun) + 0.0977 * std::cos(2.0 * moon) -
           0.0895 * std::cos(2.0 * node)) *
              kArcsec};
}

/// Whole days since 1970, rounded down also before it.
std::int64_t days_of(std::int64_t posix_utc_ns) noexcept {
  const std::int64_t days = posix_utc_ns / kNsPerDay;
  return posix_utc_ns % kNsPerDay < 0 ? days - 1 : days;
}

}  // namespace

double wrapped_turn(double angle_rad) noexcept {
  const double turns = angle_rad / (2.0 * kPi);
  return (turns - std::floor(turns)) * 2.0 * kPi;
}

JulianDate julian_date(std::int64_t posix_utc_ns) noexcept {
  const std::int64_t days = days_of(posix_utc_ns);
  return {kPosixEpochJd + static_cast<double>(days),
          static_cast<double>(posix_utc_ns - days * kNsPerDay) / static_cast<double>(kNsPerDay)};
}

double decimal_year(std::int64_t posix_utc_ns) noexcept {
  return 1970.0 + static_cast<double>(days_of(posix_utc_ns)) / 365.2425;
}

EarthAttitude earth_attitude(const JulianDate& ut1, double tt_minus_ut1_s) noexcept {
  EarthAttitude earth;
  const double ut1_days = (ut1.day - kJ2000) + ut1.fraction;
  earth.centuries = (ut1_days + tt_minus_ut1_s / 86400.0) / 36525.0;
  const double centuries = earth.centuries;
  const Nutation nut = nutation(centuries);
  earth.nutation_rad = nut.longitude_rad;
  earth.obliquity_rad =
      (84381.448 + centuries * (-46.8150 + centuries * (-0.00059 + centuries * 0.001813))) *
          kArcsec +
      nut.obliquity_rad;
  // Compute Greenwich apparent sidereal time. The fraction of the day goes in last, because it
  // carries the significant bits.
  const double ut1_centuries = ut1_days / 36525.0;
  const double whole = std::floor(ut1_days);
  const double sidereal_deg =
      280.46061837 + 360.0 * (ut1_days - whole) + 0.98564736629 * ut1_days +
      ut1_centuries * ut1_centuries * (0.000387933 - ut1_centuries / 38710000.0);
  earth.sidereal_rad =
      wrapped_turn(sidereal_deg * kDegree + nut.longitude_rad * std::cos(earth.obliquity_rad));
  return earth;
}

glm::dvec3 ecliptic_direction(double longitude_rad, double latitude_rad) noexcept {
  return {std::cos(latitude_rad) * std::cos(longitude_rad),
          std::cos(latitude_rad) * std::sin(longitude_rad), std::sin(latitude_rad)};
}

glm::dvec3 ecef_from_ecliptic(const EarthAttitude& earth, const glm::dvec3& ecliptic) noexcept {
  const double se = std::sin(earth.obliquity_rad);
  const double ce = std::cos(earth.obliquity_rad);
  const glm::dvec3 equatorial(ecliptic.x, ce * ecliptic.y - se * ecliptic.z,
                              se * ecliptic.y + ce * ecliptic.z);
  const double ss = std::sin(earth.sidereal_rad);
  const double cs = std::cos(earth.sidereal_rad);
  return {cs * equatorial.x + ss * equatorial.y, -ss * equatorial.x + cs * equatorial.y,
          equatorial.z};
}

}  // namespace emit::physics
