// SPDX-License-Identifier: Apache-2.0
// Judges the gusts of convection against sums by hand from published tables and formulas.
#include "emit/physics/climate.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "emit/physics/air_film.hpp"
#include "emit/physics/weather.hpp"

namespace {

using namespace emit::physics;

TEST(Gusts, LandGivesTheAirWhatTheSchemeSays) {
  // The saturation pressure rises by 144.7 Pa/K at 20 C (Smithsonian tables), and at 1013.25 hPa
  // the psychrometric constant is 66.9 Pa/K (Allen et al., FAO 56, to 1 %).
  const double rise = 144.7 / 66.9;
  const double dry = (0.5 * rise + 1.0) / (rise + 1.0);
  const double net_w_m2 = (0.8 * 800.0 + 350.0 - 418.8) / (1.0 + 0.38 * dry);
  const ConvectionDrive noon{
      .global_sun_w_m2 = 800.0, .longwave_down_w_m2 = 350.0, .air_k = 293.15};
  EXPECT_NEAR(land_heat_w_m2(noon), 0.9 * dry * net_w_m2 - 10.0, 3.0);
  // De Bruin and Holtslag (1982) measured 150 to 300 W/m2 between wet grass and dry land.
  EXPECT_GT(land_heat_w_m2(noon), 150.0);
  EXPECT_LT(land_heat_w_m2(noon), 300.0);
  // w = (9.81/293.15 * 1000 * H / (1.204 * 1005))^1/3, times 1.2.
  const double stir_m_s =
      std::cbrt(9.81 / 293.15 * 1000.0 * land_heat_w_m2(noon) / (1.204 * 1005.0));
  EXPECT_NEAR(convective_gust_m_s(noon), 1.2 * stir_m_s, 0.005 * stir_m_s);
}

TEST(Gusts, ColdLandMakesNone) {
  const ConvectionDrive night{.global_sun_w_m2 = 0.0, .longwave_down_w_m2 = 300.0, .air_k = 290.0};
  EXPECT_LT(land_heat_w_m2(night), 0.0);
  EXPECT_EQ(convective_gust_m_s(night), 0.0);
}

TEST(Gusts, GrowWithTheSunOverAllClimates) {
  for (const double air_k : {220.0, 260.0, 300.0, 330.0}) {
    for (const double pressure_pa : {50'000.0, 101'325.0}) {
      double before_m_s = 0.0;
      for (double sun_w_m2 = 0.0; sun_w_m2 <= 1200.0; sun_w_m2 += 50.0) {
        const double gust_m_s =
            convective_gust_m_s({.global_sun_w_m2 = sun_w_m2,
                                 .longwave_down_w_m2 = 0.8 * 5.670374e-8 * std::pow(air_k, 4.0),
                                 .air_k = air_k,
                                 .pressure_pa = pressure_pa});
        EXPECT_GE(gust_m_s, before_m_s) << air_k << " K, " << sun_w_m2 << " W/m2";
        EXPECT_LT(gust_m_s, 4.5);
        before_m_s = gust_m_s;
      }
      EXPECT_GT(before_m_s, 2.0);
    }
  }
}

TEST(Gusts, AddToTheWindInSquares) {
  Forcing weather;
  weather.air_k = 295.0;
  weather.wind_m_s = 3.0;
  weather.wind_to_east = 1.0;
  weather.gust_m_s = 2.0;
  const AirFlow flow = air_flow(weather);
  EXPECT_DOUBLE_EQ(flow.flow_m_s.x, 3.0);
  EXPECT_DOUBLE_EQ(flow.undirected_m_s, 2.0);
  // A place sets them from its own sun.
  weather.direct_normal_w_m2 = 900.0;
  weather.longwave_down_w_m2 = 350.0;
  SunPosition sun{};
  sun.direction_enu = {0.0, 0.0, 1.0};
  const GeoPlace place{Radians(0.8), Radians(0.1), Metres(500.0)};
  EXPECT_DOUBLE_EQ(at_place(weather, place, sun).gust_m_s,
                   convective_gust_m_s({900.0, 350.0, 295.0, standard_pressure_pa(500.0)}));
  sun.direction_enu = {0.0, 1.0, 0.0};
  EXPECT_EQ(at_place(weather, place, sun).gust_m_s, 0.0);
}

}  // namespace
