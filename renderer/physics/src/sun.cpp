// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sun.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <span>

#include "celestial.hpp"

namespace emit::physics {
namespace {

constexpr std::int64_t kNsPerDay = 86400LL * 1000000000LL;

/// One term amplitude * cos(phase + rate * t), with t in Julian millennia from J2000.
struct Term {
  double amplitude;  // 1e-8 rad or 1e-8 au
  double phase_rad;
  double rate_rad;
};

// Leading terms of VSOP87D for the earth: heliocentric longitude, latitude and radius, equinox of
// date (Bretagnon and Francou 1988). Terms below 8e-7 rad are left out. Together they are under 2
// arcseconds at worst and usually a fraction of that.
constexpr Term kL0[] = {
    {175347046, 0, 0},
    {3341656, 4.6692568, 6283.0758500},
    {34894, 4.62610, 12566.15170},
    {3497, 2.7441, 5753.3849},
    {3418, 2.8289, 3.5231},
    {3136, 3.6277, 77713.7715},
    {2676, 4.4181, 7860.4194},
    {2343, 6.1352, 3930.2097},
    {1324, 0.7425, 11506.7698},
    {1273, 2.0371, 529.6910},
    {1199, 1.1096, 1577.3435},
    {990, 5.233, 5884.927},
    {902, 2.045, 26.298},
    {857, 3.508, 398.149},
    {780, 1.179, 5223.694},
    {753, 2.533, 5507.553},
    {505, 4.583, 18849.228},
    {492, 4.205, 775.523},
    {357, 2.920, 0.067},
    {317, 5.849, 11790.629},
    {284, 1.899, 796.298},
    {271, 0.315, 10977.079},
    {243, 0.345, 5486.778},
    {206, 4.806, 2544.314},
    {205, 1.869, 5573.143},
    {202, 2.458, 6069.777},
    {156, 0.833, 213.299},
    {132, 3.411, 2942.463},
    {126, 1.083, 20.775},
    {115, 0.645, 0.980},
    {103, 0.636, 4694.003},
    {102, 0.976, 15720.839},
    {102, 4.267, 7.114},
    {99, 6.21, 2146.17},
    {98, 0.68, 155.42},
    {86, 5.98, 161000.69},
    {85, 1.30, 6275.96},
    {85, 3.67, 71430.70},
    {80, 1.81, 17260.15},
};
constexpr Term kL1[] = {
    {628331966747.0, 0, 0},     {206059, 2.678235, 6283.075850},
    {4303, 2.6351, 12566.1517}, {425, 1.590, 3.523},
    {119, 5.796, 26.298},       {109, 2.966, 1577.344},
    {93, 2.59, 18849.23},       {72, 1.14, 529.69},
    {68, 1.87, 398.15},         {67, 4.41, 5507.55},
    {59, 2.89, 5223.69},        {56, 2.17, 155.42},
    {45, 0.40, 796.30},         {36, 0.47, 775.52},
    {29, 2.65, 7.11},           {21, 5.34, 0.98},
    {19, 1.85, 5486.78},
};
constexpr Term kL2[] = {
    {52919, 0, 0},    {8720, 1.0721, 6283.0758}, {309, 0.867, 12566.152},
    {27, 0.05, 3.52}, {16, 5.19, 26.30},
};
constexpr Term kL3[] = {{289, 5.844, 6283.076}, {35, 0, 0}, {17, 5.49, 12566.15}};
constexpr Term kL4[] = {{114, 3.142, 0}, {8, 4.13, 6283.08}};
constexpr Term kB0[] = {
    {280, 3.199, 84334.662}, {102, 5.422, 5507.553}, {80, 3.88, 5223.69},
    {44, 3.70, 2352.87},     {32, 4.00, 1577.34},
};
constexpr Term kB1[] = {{9, 3.90, 5507.55}, {6, 1.73, 5223.69}};
constexpr Term kR0[] = {
    {100013989, 0, 0},
    {1670700, 3.0984635, 6283.0758500},
    {13956, 3.05525, 12566.15170},
    {3084, 5.1985, 77713.7715},
    {1628, 1.1739, 5753.3849},
    {1576, 2.8469, 7860.4194},
    {925, 5.453, 11506.770},
    {542, 4.564, 3930.210},
    {472, 3.661, 5884.927},
    {346, 0.964, 5507.553},
    {329, 5.900, 5223.694},
    {307, 0.299, 5573.143},
    {243, 4.273, 11790.629},
    {212, 5.847, 1577.344},
    {186, 5.022, 10977.079},
    {175, 3.012, 18849.228},
    {110, 5.055, 5486.778},
};
constexpr Term kR1[] = {{103019, 1.107490, 6283.075850}, {1721, 1.0644, 12566.1517}};

double sum(std::span<const Term> terms, double t) noexcept {
  double total = 0.0;
  for (const Term& term : terms) {
    total += term.amplitude * std::cos(term.phase_rad + term.rate_rad * t);
  }
  return total * 1e-8;
}

}  // namespace

double julian_day_0h(int year, int month, int day) noexcept {
  // Count days since 0000-03-01 of the proleptic Gregorian calendar, with months from March.
  const int y = month > 2 ? year : year - 1;
  const int m = month > 2 ? month - 3 : month + 9;
  const int era = (y >= 0 ? y : y - 399) / 400;
  const int year_of_era = y - era * 400;
  const int day_of_year = (153 * m + 2) / 5 + day - 1;
  const int day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
  return 1721119.5 + era * 146097.0 + day_of_era;
}

double delta_t_s(double decimal_year) noexcept {
  const double y = decimal_year;
  if (y < 1941.0) {
    const double t = y - 1920.0;
    return 21.20 + t * (0.84493 + t * (-0.076100 + t * 0.0020936));
  }
  if (y < 1961.0) {
    const double t = y - 1950.0;
    return 29.07 + t * (0.407 + t * (-1.0 / 233.0 + t / 2547.0));
  }
  if (y < 1986.0) {
    const double t = y - 1975.0;
    return 45.45 + t * (1.067 + t * (-1.0 / 260.0 - t / 718.0));
  }
  if (y < 2005.0) {
    const double t = y - 2000.0;
    return 63.86 +
           t * (0.3345 + t * (-0.060374 + t * (0.0017275 + t * (0.000651814 + t * 0.00002373599))));
  }
  // The earth has turned faster since 2005 than the polynomial foresaw.
  if (y < 2020.0) {
    return 64.7 + (y - 2005.0) * 0.3;
  }
  if (y < 2030.0) {
    return 69.2;
  }
  return 69.2 + 0.45 * (y - 2030.0);
}

SunEcliptic sun_ecliptic(const EarthAttitude& earth) noexcept {
  // Sum the heliocentric position of the earth; the geocentric sun lies in the opposite direction.
  const double t = earth.centuries / 10.0;
  const double earth_longitude =
      sum(kL0, t) + t * (sum(kL1, t) + t * (sum(kL2, t) + t * (sum(kL3, t) + t * sum(kL4, t))));
  const double earth_latitude = sum(kB0, t) + t * sum(kB1, t);
  const double distance_au = sum(kR0, t) + t * sum(kR1, t);
  // Correct to FK5, and for nutation in longitude and aberration. Aberration includes the light's
  // travel time.
  return {earth_longitude + kPi - 0.09033 * kArcsec + earth.nutation_rad -
              20.4898 * kArcsec / distance_au,
          -earth_latitude, distance_au};
}

SunPosition sun_position_ut1(double julian_day, double day_fraction, double tt_minus_ut1_s,
                             const GeoPlace& place) noexcept {
  const EarthAttitude earth = earth_attitude({julian_day, day_fraction}, tt_minus_ut1_s);
  const SunEcliptic sun = sun_ecliptic(earth);
  // Turn to the earth-fixed frame and subtract the observer's position, which gives the parallax.
  const glm::dvec3 sun_ecef_m =
      sun.distance_au * kAstronomicalUnitM *
      ecef_from_ecliptic(earth, ecliptic_direction(sun.longitude_rad, sun.latitude_rad));
  const glm::dvec3 to_sun_m = sun_ecef_m - ecef_m(place);
  const double range_m = glm::length(to_sun_m);

  SunPosition result;
  result.direction_enu = glm::normalize(glm::transpose(ecef_from_enu(place)) * to_sun_m);
  const glm::dvec3& enu = result.direction_enu;
  result.azimuth = Radians(wrapped_turn(std::atan2(enu.x, enu.y)));
  result.elevation = Radians(std::atan2(enu.z, std::hypot(enu.x, enu.y)));
  result.distance_au = range_m / kAstronomicalUnitM;
  return result;
}

SunPosition sun_position(std::int64_t posix_utc_ns, const GeoPlace& place) noexcept {
  const JulianDate date = julian_date(posix_utc_ns);
  return sun_position_ut1(date.day, date.fraction, delta_t_s(decimal_year(posix_utc_ns)), place);
}

double mean_solar_hours(std::int64_t posix_utc_ns, Radians longitude) noexcept {
  std::int64_t rest_ns = posix_utc_ns % kNsPerDay;
  if (rest_ns < 0) {
    rest_ns += kNsPerDay;
  }
  const double turns = static_cast<double>(rest_ns) / static_cast<double>(kNsPerDay) +
                       longitude.value() / (2.0 * kPi);
  return 24.0 * (turns - std::floor(turns));
}

}  // namespace emit::physics
