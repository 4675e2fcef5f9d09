// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/climate/surface_water.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "emit/physics/climate/rain.hpp"
#include "emit/physics/evaporation.hpp"

namespace emit::physics {
namespace {

constexpr double kDayS = 86'400.0;
constexpr std::int64_t kHourNs = 3'600'000'000'000;

const WaterStore kAsphalt{.capacity_mm = 0.48};
const WaterStore kLoam{.kind = WaterStore::Kind::soil, .capacity_mm = 19.0, .ready_mm = 9.0};

TEST(SurfaceWater, WetnessIsThatOfTheSources) {
  // Deardorff: (S/C)^(2/3).
  EXPECT_DOUBLE_EQ(wet_frac(kAsphalt, 0.48), 1.0);
  EXPECT_NEAR(wet_frac(kAsphalt, 0.06), 0.25, 1e-12);
  EXPECT_EQ(wet_frac(kAsphalt, 0.0), 0.0);
  EXPECT_EQ(wet_frac({}, 1.0), 0.0);
  // FAO-56 eq. 74, as another program has it: soil of 20.003 mm, of which 9 mm evaporate freely.
  // The numbers are the depth that has evaporated and the coefficient Kr of the day after.
  const WaterStore soil{.kind = WaterStore::Kind::soil, .capacity_mm = 20.003, .ready_mm = 9.0};
  for (const auto& [gone_mm, kr] :
       {std::pair{7.063, 1.0}, std::pair{15.185, 0.438}, std::pair{9.669, 0.939},
        std::pair{9.261, 0.976}, std::pair{18.044, 0.178}, std::pair{20.003, 0.0}}) {
    EXPECT_NEAR(wet_frac(soil, 20.003 - gone_mm), kr, 6e-4) << gone_mm;
  }
  for (const double wetness : {0.0, 0.3, 0.99}) {
    EXPECT_NEAR(wet_frac(soil, soil_water_mm(soil, wetness)), wetness, 1e-12);
  }
  EXPECT_EQ(soil_water_mm(soil, 1.0), soil.capacity_mm);
}

TEST(SurfaceWater, FilmDriesInThreeTimesWhatAnEvenFilmWouldTake) {
  // The integral of dS/w(S) over the store is 3 C.
  constexpr double kOpenMmS = 0.5 / 3600.0;
  const double dry_s = 3.0 * 0.48 / kOpenMmS;
  EXPECT_GT(advance_water(kAsphalt, 0.48, 0.0, kOpenMmS, 0.999 * dry_s).water_mm, 0.0);
  EXPECT_EQ(advance_water(kAsphalt, 0.48, 0.0, kOpenMmS, 1.001 * dry_s).water_mm, 0.0);
  // A step without rain is exact: one is as good as many.
  double water_mm = 0.48;
  for (int i = 0; i < 100; ++i) {
    water_mm = advance_water(kAsphalt, water_mm, 0.0, kOpenMmS, 0.005 * dry_s).water_mm;
  }
  EXPECT_NEAR(water_mm, advance_water(kAsphalt, 0.48, 0.0, kOpenMmS, 0.5 * dry_s).water_mm, 1e-12);
  EXPECT_NEAR(water_mm, 0.48 / 8.0, 1e-12);
}

TEST(SurfaceWater, SoilDriesLikeMeasuredSoils) {
  // Ritchie (Water Resour. Res. 8, 1972): after U mm of free evaporation, soils gave alpha sqrt(t)
  // mm in t days. The stores are the middle of FAO-56 table 19 for loam and silty clay loam.
  struct Soil {
    double u_mm;
    double alpha_mm;
    WaterStore store;
  };
  const Soil soils[] = {
      {9.0, 4.04, kLoam},  // Yolo loam
      {12.0, 5.08, {.kind = WaterStore::Kind::soil, .capacity_mm = 24.5, .ready_mm = 9.5}}};
  for (const Soil& soil : soils) {
    constexpr double kOpenMmDay = 6.0;
    double worst = 0.0;
    for (double days = 2.0; days <= 10.0; days += 1.0) {
      const double first_days = soil.u_mm / kOpenMmDay;
      const double measured_mm = days < first_days
                                     ? kOpenMmDay * days
                                     : soil.u_mm + soil.alpha_mm * std::sqrt(days - first_days);
      const double ours_mm =
          advance_water(soil.store, soil.store.capacity_mm, 0.0, kOpenMmDay / kDayS, days * kDayS)
              .evaporated_mm;
      worst = std::max(worst, std::abs(ours_mm / measured_mm - 1.0));
    }
    EXPECT_LT(worst, 0.15) << soil.u_mm;
  }
}

TEST(SurfaceWater, BalanceClosesWhateverFallsAndEvaporates) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (const WaterStore& store : {kAsphalt, kLoam, WaterStore{.capacity_mm = 1.9}}) {
    double water_mm = 0.0;
    double in_mm = 0.0;
    double out_mm = 0.0;
    for (int i = 0; i < 20'000; ++i) {
      const double rain_mm = unit(random) < 0.2 ? 3.0 * unit(random) : 0.0;
      const double open_mm_s = (unit(random) - 0.2) * 1e-3;
      const double dt_s = std::pow(10.0, 5.0 * unit(random));
      const StoredWater after = advance_water(store, water_mm, rain_mm, open_mm_s, dt_s);
      ASSERT_GE(after.water_mm, 0.0);
      ASSERT_LE(after.water_mm, store.capacity_mm * (1.0 + 1e-12));
      ASSERT_GE(after.drained_mm, 0.0);
      // No surface gives more than one that is wet all over.
      ASSERT_LE(after.evaporated_mm, std::max(0.0, open_mm_s) * dt_s * (1.0 + 1e-9));
      water_mm = after.water_mm;
      in_mm += rain_mm;
      out_mm += after.evaporated_mm + after.drained_mm;
    }
    EXPECT_NEAR(in_mm, out_mm + water_mm, 1e-6 * in_mm);
  }
}

TEST(SurfaceWater, RainAndDryingTakePlaceTogether) {
  // Half an hour of rain on a surface that dries, against steps of one second.
  for (const WaterStore& store : {kAsphalt, kLoam}) {
    constexpr double kRainMm = 0.6;
    constexpr double kOpenMmS = 4e-4;
    const StoredWater once = advance_water(store, 0.05, kRainMm, kOpenMmS, 1800.0);
    double water_mm = 0.05;
    double evaporated_mm = 0.0;
    for (int i = 0; i < 18'000; ++i) {
      const double gone_mm = std::min(water_mm, 0.1 * kOpenMmS * wet_frac(store, water_mm));
      evaporated_mm += gone_mm;
      water_mm = std::min(store.capacity_mm, water_mm - gone_mm + kRainMm / 18'000.0);
    }
    EXPECT_NEAR(once.water_mm, water_mm, 2e-3);
    EXPECT_NEAR(once.evaporated_mm, evaporated_mm, 2e-3);
  }
}

TEST(SurfaceWater, FilmTakesPartBesideTheStomata) {
  const MoistAir air = moist_air(293.15, 101'325.0, 1200.0);
  const MoistSurface grass{
      .wetness_frac = 1.0, .resistance_s_m = 70.0, .night_resistance_s_m = 200.0};
  MoistSurface wet = grass;
  wet.film_frac = 1.0;
  MoistSurface half = grass;
  half.film_frac = 0.5;
  const auto k = [&](const MoistSurface& surface) {
    FosterDrive<double> drive{.film_w_m2_k = 12.0};
    add_moisture(surface, air, 500.0, drive);
    return drive.evaporation_w_m2_pa;
  };
  EXPECT_NEAR(k(wet), 12.0 / air.psychrometric_pa_k, 1e-12);
  EXPECT_NEAR(k(half), 0.5 * (k(wet) + k(grass)), 1e-12);
  MoistSurface asphalt;
  EXPECT_TRUE(asphalt.dry());
  asphalt.film_frac = 0.25;
  EXPECT_FALSE(asphalt.dry());
  EXPECT_NEAR(k(asphalt), 0.25 * k(wet), 1e-12);
}

TEST(Rain, DepthIsThatOfTheGauge) {
  // A row holds the rate since the row before.
  std::vector<WeatherSample> rows(4);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].sim_time_ns = static_cast<std::int64_t>(i) * kHourNs;
  }
  rows[0].rain_mm_h = 9.0;  // before the table
  rows[1].rain_mm_h = 2.0;
  rows[3].rain_mm_h = 0.5;
  const RainDepth depth(rows);
  EXPECT_FALSE(depth.is_dry());
  EXPECT_EQ(depth.at_mm(-kHourNs), 0.0);
  EXPECT_NEAR(depth.at_mm(kHourNs / 4), 0.5, 1e-12);
  EXPECT_NEAR(depth.at_mm(2 * kHourNs), 2.0, 1e-12);
  EXPECT_NEAR(depth.at_mm(9 * kHourNs), 2.5, 1e-12);
  EXPECT_EQ(rain_rate_mm_h(rows, kHourNs / 4), 2.0);
  EXPECT_EQ(rain_rate_mm_h(rows, kHourNs), 2.0);
  EXPECT_EQ(rain_rate_mm_h(rows, kHourNs + 1), 0.0);
  EXPECT_EQ(rain_rate_mm_h(rows, 4 * kHourNs), 0.0);
  // A single row holds at all times.
  rows.resize(1);
  EXPECT_NEAR(RainDepth(rows).at_mm(2 * kHourNs) - RainDepth(rows).at_mm(kHourNs), 9.0, 1e-9);
  rows[0].rain_mm_h = 0.0;
  EXPECT_TRUE(RainDepth(rows).is_dry());
}

TEST(Evaporation, DewPointIsWhereTheAirIsFull) {
  for (const double kelvin : {240.0, 273.15, 293.15, 310.0}) {
    EXPECT_NEAR(dew_point_k(saturation_over_water_pa(kelvin)), kelvin, 1e-9);
  }
}

}  // namespace
}  // namespace emit::physics
