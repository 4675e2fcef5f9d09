// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/geodesy.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"

namespace emit::physics {
namespace {

struct KnownPlace {
  double latitude_deg;
  double longitude_deg;
  double height_m;
  glm::dvec3 ecef;

  [[nodiscard]] GeoPlace place() const {
    return {degrees(latitude_deg), degrees(longitude_deg), Metres(height_m)};
  }
};

/// Values of PROJ 9.1.1: cs2cs -f %.6f EPSG:4979 EPSG:4978.
const std::vector<KnownPlace> kPlaces = {
    {0.0, 0.0, 0.0, {6378137.0, 0.0, 0.0}},
    {0.0, 180.0, 100.0, {-6378237.0, 0.0, 0.0}},
    {90.0, 0.0, 0.0, {0.0, 0.0, 6356752.314245}},
    {-90.0, 0.0, -10000.0, {0.0, 0.0, -6346752.314245}},
    {48.56, 11.26, 400.0, {4148091.484026, 825859.346902, 4758615.894913}},
    {-33.9, 151.2, -10000.0, {-4636672.574318, 2549032.318426, -3531667.896815}},
    {38.2057613, -90.5020576, 1234.5, {-43981.396966, -5019113.199350, 3924179.723510}},
    {27.99, 86.93, 1e6, {349145.826661, 6509913.461571, 3444844.207184}},
    {89.999999, 45.0, 35786e3, {0.520627, 0.520627, 42142752.314245}},
    {45.0, -120.0, 1e8, {-37614134.498752, -65149592.034568, 75198026.527521}}};

/// The example of a point in the North Sea in EPSG guidance note 7-2, section 4.1.1 (geographic and
/// geocentric conversions): 53 deg 48' 33.820" N, 2 deg 07' 46.380" E, 73.0 m. It has three
/// decimals.
TEST(Geodesy, TheExampleOfEpsgGuidanceNote7) {
  const GeoPlace place{degrees(53.0 + 48.0 / 60.0 + 33.820 / 3600.0),
                       degrees(2.0 + 7.0 / 60.0 + 46.380 / 3600.0), Metres(73.0)};
  const glm::dvec3 published(3771793.968, 140253.342, 5124304.349);
  EXPECT_LT(glm::distance(ecef_m(place), published), 1e-3);
  const GeoPlace back = place_at_ecef(published);
  EXPECT_NEAR(to_degrees(back.latitude), to_degrees(place.latitude), 0.0005 / 3600.0);
  EXPECT_NEAR(to_degrees(back.longitude), to_degrees(place.longitude), 0.0005 / 3600.0);
  EXPECT_NEAR(back.height.value(), 73.0, 1e-3);
}

TEST(Geodesy, PositionsAndPlacesAreThoseOfProj) {
  for (const KnownPlace& known : kPlaces) {
    EXPECT_LT(glm::distance(ecef_m(known.place()), known.ecef), 1.5e-6) << known.latitude_deg;
    const GeoPlace back = place_at_ecef(known.ecef);
    // The references have six decimals of a metre.
    EXPECT_NEAR(back.latitude.value(), known.latitude_deg * kDegree, 1e-12);
    EXPECT_NEAR(back.height.value(), known.height_m, 1.5e-6);
    if (std::abs(known.latitude_deg) < 89.0) {
      EXPECT_NEAR(back.longitude.value(), known.longitude_deg * kDegree, 1e-12);
    }
  }
}

TEST(Geodesy, EveryPlaceComesBackFromTenKilometresBelowToAHundredThousandAbove) {
  for (const double height_m : {-10e3, -500.0, 0.0, 1.0, 9e3, 100e3, 1000e3, 36e6, 1e8}) {
    for (int step = -1800; step <= 1800; ++step) {
      const double latitude_deg = 0.05 * step;
      const GeoPlace place{degrees(latitude_deg), degrees(0.1 * step), Metres(height_m)};
      const GeoPlace back = place_at_ecef(ecef_m(place));
      ASSERT_NEAR(back.latitude.value(), place.latitude.value(), 1e-12) << height_m;
      // Height is a small difference of large numbers: the bound is a few units of the last place.
      ASSERT_NEAR(back.height.value(), height_m, height_m > 1e6 ? 1e-7 : 1e-8) << latitude_deg;
      if (std::abs(step) < 1800) {
        // Longitudes close to the pole are as uncertain as the position is.
        ASSERT_NEAR(back.longitude.value(), place.longitude.value(), 1e-11) << latitude_deg;
      }
    }
  }
}

TEST(Geodesy, TheLocalFrameIsARotationWithUpAlongTheNormal) {
  for (const KnownPlace& known : kPlaces) {
    const glm::dmat3 frame = ecef_from_enu(known.place());
    EXPECT_NEAR(glm::determinant(frame), 1.0, 1e-14);
    GeoPlace higher = known.place();
    higher.height = higher.height + Metres(1000.0);
    const glm::dvec3 up = (ecef_m(higher) - ecef_m(known.place())) / 1000.0;
    EXPECT_LT(glm::distance(frame[2], up), 1e-10);
    EXPECT_NEAR(frame[0].z, 0.0, 1e-15);  // east is horizontal
    EXPECT_GE(frame[1].z, 0.0);           // north leads towards the pole
  }
}

/// The value of PROJ 9.1.1: gdaltransform -s_srs EPSG:4326 -t_srs '+proj=ortho +lat_0=48.015
/// +lon_0=11.015 +datum=WGS84' of 11.5, 48.3.
TEST(Geodesy, ThePlaneOfTheHorizonIsTheOrthographicProjectionOfProj) {
  const HorizonPlane plane({degrees(48.015), degrees(11.015), Metres(123.0)});
  const auto point = plane.ellipsoid_point(Metres(35982.531170232), Metres(31803.1874481195));
  ASSERT_TRUE(point);
  EXPECT_LT(
      glm::distance(point->position_ecef_m, ecef_m({degrees(48.3), degrees(11.5), Metres(0.0)})),
      1e-6);
}

TEST(Geodesy, PointsOfTheHorizonsPlaneComeBackWithTheirNormals) {
  for (const KnownPlace& known : kPlaces) {
    GeoPlace foot = known.place();
    foot.height = Metres(0.0);
    const HorizonPlane plane(known.place());
    for (const double east_m : {-400e3, -50e3, 0.0, 1.0, 300e3}) {
      for (const double north_m : {-300e3, -1.0, 0.0, 50e3, 400e3}) {
        const auto point = plane.ellipsoid_point(Metres(east_m), Metres(north_m));
        ASSERT_TRUE(point);
        const glm::dvec3 enu =
            glm::transpose(ecef_from_enu(foot)) * (point->position_ecef_m - ecef_m(foot));
        EXPECT_NEAR(enu.x, east_m, 1e-8);
        EXPECT_NEAR(enu.y, north_m, 1e-8);
        const GeoPlace place = place_at_ecef(point->position_ecef_m);
        EXPECT_NEAR(place.height.value(), 0.0, 1e-8);
        EXPECT_LT(glm::distance(point->up_ecef, ecef_from_enu(place)[2]), 1e-12);
      }
    }
    EXPECT_FALSE(plane.ellipsoid_point(Metres(6.4e6), Metres(0.0)));
  }
}

TEST(Geodesy, HeadingPitchAndRollComeBack) {
  for (const double heading : {-3.1, -1.0, 0.0, 0.5, 3.1}) {
    for (const double pitch : {-1.57, -0.4, 0.0, 1.0, 1.57}) {
      for (const double roll : {-3.0, -0.2, 0.0, 1.5, 3.0}) {
        const HeadingPitchRoll back =
            heading_pitch_roll(world_from_body_heading_pitch_roll(heading, pitch, roll));
        // Close to the vertical, heading and roll are known less well than their sum.
        EXPECT_NEAR(back.heading_rad, heading, 1e-12);
        EXPECT_NEAR(back.pitch_rad, pitch, 1e-12);
        EXPECT_NEAR(back.roll_rad, roll, 1e-12);
      }
    }
  }
}

TEST(Geodesy, StraightUpHasNoRoll) {
  const double quarter = 0.5 * kPi;
  const HeadingPitchRoll up =
      heading_pitch_roll(world_from_body_heading_pitch_roll(0.3, quarter, 0.0));
  EXPECT_NEAR(up.heading_rad, 0.3, 1e-12);
  EXPECT_NEAR(up.pitch_rad, quarter, 1e-9);
  EXPECT_EQ(up.roll_rad, 0.0);
}

/// Asks an installed PROJ for places all over the earth.
TEST(Geodesy, AgreesWithAnInstalledProj) {
  if (std::system("command -v cs2cs > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "cs2cs of PROJ (Debian proj-bin) is not installed";
  }
  const std::string file = testing::TempDir() + "emit_geodesy_places.txt";
  std::vector<GeoPlace> places;
  std::FILE* out = std::fopen(file.c_str(), "w");
  ASSERT_NE(out, nullptr);
  for (int i = 0; i < 500; ++i) {
    const double latitude_deg = std::fmod(37.7 * i, 180.0) - 90.0;
    const double longitude_deg = std::fmod(71.3 * i, 360.0) - 180.0;
    const double height_m = std::fmod(20123.0 * i, 1010e3) - 10e3;
    places.push_back({degrees(latitude_deg), degrees(longitude_deg), Metres(height_m)});
    fmt::print(out, "{:.12f} {:.12f} {:.6f}\n", latitude_deg, longitude_deg, height_m);
  }
  std::fclose(out);
  const std::string command = "cs2cs -f %.9f EPSG:4979 EPSG:4978 " + file;
  std::FILE* in = ::popen(command.c_str(), "r");
  ASSERT_NE(in, nullptr);
  double worst_m = 0.0;
  double worst_rad = 0.0;
  std::size_t read = 0;
  for (const GeoPlace& place : places) {
    glm::dvec3 proj(0.0);
    if (std::fscanf(in, "%lf %lf %lf", &proj.x, &proj.y, &proj.z) != 3) break;
    ++read;
    worst_m = std::max(worst_m, glm::distance(ecef_m(place), proj));
    const GeoPlace back = place_at_ecef(proj);
    worst_m = std::max(worst_m, std::abs(back.height.value() - place.height.value()));
    worst_rad = std::max(worst_rad, std::abs(back.latitude.value() - place.latitude.value()));
  }
  ::pclose(in);
  std::remove(file.c_str());
  EXPECT_EQ(read, places.size());
  EXPECT_LT(worst_m, 1e-6);
  EXPECT_LT(worst_rad, 1e-12);
}

}  // namespace
}  // namespace emit::physics
