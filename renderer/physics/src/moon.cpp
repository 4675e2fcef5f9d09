// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/moon.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "celestial.hpp"
#include "emit/physics/sun.hpp"

namespace emit::physics {
namespace {

/// Term of the moon's longitude and distance: multiples of the arguments D, M, M' and F, then 1e-6
/// deg and m.
struct LongitudeTerm {
  int d, m, n, f;
  double longitude;
  double distance;
};
/// Term of the moon's latitude, 1e-6 deg.
struct LatitudeTerm {
  int d, m, n, f;
  double latitude;
};

// Leading terms of ELP-2000/82 (Chapront). What is left out adds up to some thousandths of a
// degree.
constexpr LongitudeTerm kLongitude[] = {
    {0, 0, 1, 0, 6288774, -20905355}, {2, 0, -1, 0, 1274027, -3699111},
    {2, 0, 0, 0, 658314, -2955968},   {0, 0, 2, 0, 213618, -569925},
    {0, 1, 0, 0, -185116, 48888},     {0, 0, 0, 2, -114332, -3149},
    {2, 0, -2, 0, 58793, 246158},     {2, -1, -1, 0, 57066, -152138},
    {2, 0, 1, 0, 53322, -170733},     {2, -1, 0, 0, 45758, -204586},
    {0, 1, -1, 0, -40923, -129620},   {1, 0, 0, 0, -34720, 108743},
    {0, 1, 1, 0, -30383, 104755},     {2, 0, 0, -2, 15327, 10321},
    {0, 0, 1, 2, -12528, 0},          {0, 0, 1, -2, 10980, 79661},
    {4, 0, -1, 0, 10675, -34782},     {0, 0, 3, 0, 10034, -23210},
    {4, 0, -2, 0, 8548, -21636},      {2, 1, -1, 0, -7888, 24208},
    {2, 1, 0, 0, -6766, 30824},       {1, 0, -1, 0, -5163, -8379},
    {1, 1, 0, 0, 4987, -16675},       {2, -1, 1, 0, 4036, -12831},
    {2, 0, 2, 0, 3994, -10445},       {4, 0, 0, 0, 3861, -11650},
    {2, 0, -3, 0, 3665, 14403},       {0, 1, -2, 0, -2689, -7003},
    {2, 0, -1, 2, -2602, 0},          {2, -1, -2, 0, 2390, 10056},
    {1, 0, 1, 0, -2348, 6322},        {2, -2, 0, 0, 2236, -9884},
    {0, 1, 2, 0, -2120, 5751}};
constexpr LatitudeTerm kLatitude[] = {
    {0, 0, 0, 1, 5128122}, {0, 0, 1, 1, 280602},  {0, 0, 1, -1, 277693}, {2, 0, 0, -1, 173237},
    {2, 0, -1, 1, 55413},  {2, 0, -1, -1, 46271}, {2, 0, 0, 1, 32573},   {0, 0, 2, 1, 17198},
    {2, 0, 1, -1, 9266},   {0, 0, 2, -1, 8822},   {2, -1, 0, -1, 8216},  {2, 0, -2, -1, 4324},
    {2, 0, 1, 1, 4200},    {2, 1, 0, -1, -3359},  {2, -1, -1, 1, 2463},  {2, -1, 0, 1, 2211},
    {2, -1, -1, -1, 2065}, {0, 1, -1, -1, -1870}, {4, 0, -1, -1, 1828},  {0, 1, 0, 1, -1794},
    {0, 0, 0, 3, -1749},   {0, 1, -1, 1, -1565},  {1, 0, 0, 1, -1491},   {0, 1, 1, 1, -1475},
    {0, 1, 1, -1, -1410},  {0, 1, 0, -1, -1344},  {1, 0, 0, -1, -1335}};

}  // namespace

MoonEcliptic moon_ecliptic(double tt_centuries) noexcept {
  const double t = tt_centuries;
  const double mean =
      (218.3164477 + t * (481267.88123421 + t * (-0.0015786 + t / 538841.0))) * kDegree;
  const double d = (297.8501921 + t * (445267.1114034 + t * (-0.0018819 + t / 545868.0))) * kDegree;
  const double m = (357.5291092 + t * (35999.0502909 + t * -0.0001536)) * kDegree;
  const double n = (134.9633964 + t * (477198.8675055 + t * (0.0087414 + t / 69699.0))) * kDegree;
  const double f = (93.2720950 + t * (483202.0175233 + t * -0.0036539)) * kDegree;
  const double venus = (119.75 + 131.849 * t) * kDegree;
  const double jupiter = (53.09 + 479264.290 * t) * kDegree;
  const double third = (313.45 + 481266.484 * t) * kDegree;
  // Terms with the sun's anomaly shrink with the eccentricity of the earth's orbit.
  const double eccentricity = 1.0 - 0.002516 * t - 0.0000074 * t * t;
  const auto scale = [&](int multiple) {
    const int size = std::abs(multiple);
    return size == 2 ? eccentricity * eccentricity : size == 1 ? eccentricity : 1.0;
  };
  double longitude =
      3958.0 * std::sin(venus) + 1962.0 * std::sin(mean - f) + 318.0 * std::sin(jupiter);
  double latitude = -2235.0 * std::sin(mean) + 382.0 * std::sin(third) +
                    175.0 * std::sin(venus - f) + 175.0 * std::sin(venus + f) +
                    127.0 * std::sin(mean - n) - 115.0 * std::sin(mean + n);
  double distance_m = 385000560.0;
  for (const LongitudeTerm& term : kLongitude) {
    const double angle = term.d * d + term.m * m + term.n * n + term.f * f;
    longitude += scale(term.m) * term.longitude * std::sin(angle);
    distance_m += scale(term.m) * term.distance * std::cos(angle);
  }
  for (const LatitudeTerm& term : kLatitude) {
    latitude +=
        scale(term.m) * term.latitude * std::sin(term.d * d + term.m * m + term.n * n + term.f * f);
  }
  return {wrapped_turn(mean + longitude * 1e-6 * kDegree), latitude * 1e-6 * kDegree, distance_m};
}

MoonPosition moon_position(std::int64_t posix_utc_ns, const GeoPlace& place) noexcept {
  const EarthAttitude earth =
      earth_attitude(julian_date(posix_utc_ns), delta_t_s(decimal_year(posix_utc_ns)));
  const MoonEcliptic moon = moon_ecliptic(earth.centuries);
  const SunEcliptic sun = sun_ecliptic(earth);
  const glm::dvec3 moon_m =
      moon.distance_m *
      ecef_from_ecliptic(
          earth, ecliptic_direction(moon.longitude_rad + earth.nutation_rad, moon.latitude_rad));
  const glm::dvec3 sun_m =
      sun.distance_au * kAstronomicalUnitM *
      ecef_from_ecliptic(earth, ecliptic_direction(sun.longitude_rad, sun.latitude_rad));
  const glm::dvec3 to_moon_m = moon_m - ecef_m(place);
  const glm::dvec3 moon_to_sun_m = sun_m - moon_m;
  MoonPosition out;
  out.distance_m = glm::length(to_moon_m);
  const glm::dmat3 enu_from_ecef = glm::transpose(ecef_from_enu(place));
  out.direction_enu = glm::normalize(enu_from_ecef * to_moon_m);
  out.to_sun_enu = glm::normalize(enu_from_ecef * moon_to_sun_m);
  out.sun_au = glm::length(moon_to_sun_m) / kAstronomicalUnitM;
  return out;
}

double moon_temperature_k(double cosine, double sun_au) noexcept {
  constexpr double kNightK = 100.0;
  const double lit_k = kMoonSubsolarK / std::sqrt(sun_au) * std::pow(std::max(cosine, 0.0), 0.25);
  return std::max(lit_k, kNightK);
}

}  // namespace emit::physics
