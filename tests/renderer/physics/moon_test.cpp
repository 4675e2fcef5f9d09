// SPDX-License-Identifier: Apache-2.0
// The moon's place against a published example and against eclipses, and its heat.
#include "emit/physics/sky/moon.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"

namespace emit::physics {
namespace {

constexpr std::int64_t kNsPerS = 1'000'000'000;

GeoPlace place_deg(double lat, double lon) {
  return {Radians(lat * kDegree), Radians(lon * kDegree), Metres(0.0)};
}

double apart_deg(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) / kDegree;
}

TEST(MoonPosition, is_that_of_the_published_example) {
  // Meeus, Astronomical Algorithms, example 47.a: 1992 April 12, 0h dynamical time.
  const MoonEcliptic moon = moon_ecliptic(-0.077221081451);
  EXPECT_NEAR(moon.longitude_rad / kDegree, 133.162655, 0.005);
  EXPECT_NEAR(moon.latitude_rad / kDegree, -3.229126, 0.005);
  EXPECT_NEAR(moon.distance_m, 368409.7e3, 30e3);
}

TEST(MoonPosition, covers_the_sun_where_and_when_eclipses_were_greatest) {
  struct Eclipse {
    std::int64_t posix_s;
    double lat_deg;
    double lon_deg;
  };
  // NASA catalogue of solar eclipses: instant (UT) and place of the greatest eclipse, all of them
  // total.
  for (const Eclipse& e : {Eclipse{934369408, 45.1, 24.3},          // 1999-08-11 11:03:28
                           Eclipse{1503339932, 36.97, -87.67},      // 2017-08-21 18:25:32
                           Eclipse{1712600238, 25.29, -104.14}}) {  // 2024-04-08 18:17:18
    const GeoPlace place = place_deg(e.lat_deg, e.lon_deg);
    const SunPosition sun = sun_position(e.posix_s * kNsPerS, place);
    const MoonPosition moon = moon_position(e.posix_s * kNsPerS, place);
    EXPECT_LT(apart_deg(sun.direction_enu, moon.direction_enu), 0.012);
    EXPECT_GT(std::asin(kMoonRadiusM / moon.distance_m), kSunSemiAngleRad / sun.distance_au);
    // The moon turns its night to the earth.
    EXPECT_LT(glm::dot(moon.to_sun_enu, -moon.direction_enu), -0.9999);
  }
}

TEST(MoonPosition, lies_in_the_shadow_of_the_earth_in_a_lunar_eclipse) {
  // Greatest eclipse of 2022-05-16, 04:11:28 UT: the moon passed 0.2532 radii of the earth from the
  // axis of the shadow. The centre of the earth sees it as the point below the moon does.
  const std::int64_t at = 1652674288 * kNsPerS;
  const GeoPlace below = place_deg(-19.3, -63.7);
  const MoonPosition moon = moon_position(at, below);
  EXPECT_GT(moon.direction_enu.z, 0.999);
  const glm::dvec3 from_centre = moon.distance_m * moon.direction_enu + glm::dvec3(0, 0, 6.374e6);
  const double off_axis = glm::length(glm::cross(from_centre, moon.to_sun_enu)) / 6.378e6;
  EXPECT_NEAR(off_axis, 0.2532, 0.03);
  EXPECT_GT(glm::dot(moon.to_sun_enu, -moon.direction_enu), 0.999);
}

TEST(MoonTemperature, is_in_balance_with_the_sun) {
  // Diviner: 387 to 397 K under the sun (Vasavada et al. 2012).
  EXPECT_NEAR(moon_temperature_k(1.0, 1.0), 392.0, 5.0);
  for (const double cosine : {0.05, 0.3, 0.9}) {
    const double k = moon_temperature_k(cosine, 1.0);
    EXPECT_NEAR(std::pow(k / moon_temperature_k(1.0, 1.0), 4.0), cosine, 1e-9);
  }
  EXPECT_EQ(moon_temperature_k(-0.4, 1.0), 100.0);
  EXPECT_LT(moon_temperature_k(1.0, 1.017), moon_temperature_k(1.0, 0.983));
}

}  // namespace
}  // namespace emit::physics
