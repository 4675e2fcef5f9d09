// SPDX-License-Identifier: Apache-2.0
// Evaporation against published numbers: tables and examples of FAO-56 (Allen et al. 1998), a
// psychrometric table, and the closed form of Penman and Monteith.
#include "emit/physics/evaporation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/weather.hpp"

namespace emit::physics {
namespace {

constexpr double kZero = kZeroCelsiusK;

TEST(Evaporation, SaturationIsThatOfPublishedTables) {
  // FAO-56 annex 2, tables 2.3 and 2.4.
  struct Row {
    double celsius;
    double pressure_kpa;
    double slope_kpa_k;
  };
  for (const Row& row : {Row{1.0, 0.657, 0.047}, Row{10.0, 1.228, 0.082}, Row{20.0, 2.338, 0.145},
                         Row{30.0, 4.243, 0.243}, Row{40.0, 7.376, 0.393}}) {
    const auto water = saturation(kZero + row.celsius);
    EXPECT_NEAR(1e-3 * water.pressure_pa, row.pressure_kpa, 1e-3) << row.celsius;
    EXPECT_NEAR(1e-3 * water.slope_pa_k, row.slope_kpa_k, 1e-3) << row.celsius;
    EXPECT_NEAR(saturation_over_water_pa(kZero + row.celsius), water.pressure_pa, 1e-9);
  }
  // Over ice, Smithsonian meteorological tables.
  for (const auto& [celsius, pascal] :
       {std::pair{-10.0, 259.9}, std::pair{-20.0, 103.2}, std::pair{-30.0, 38.0}}) {
    EXPECT_NEAR(saturation(kZero + celsius).pressure_pa, pascal, 1e-2 * pascal) << celsius;
  }
  // A humidity refers to water at any temperature: 286.3 Pa at -10 C.
  EXPECT_NEAR(saturation_over_water_pa(kZero - 10.0), 286.3, 1.0);
}

TEST(Evaporation, SaturationStaysFiniteAndRisesAtEveryTemperature) {
  double before_pa = -1.0;
  for (double k = 0.0; k < 2000.0; k += 0.5) {
    const auto water = saturation(k);
    ASSERT_TRUE(std::isfinite(water.pressure_pa) && std::isfinite(water.slope_pa_k)) << k;
    ASSERT_GE(water.pressure_pa, before_pa) << k;
    ASSERT_GE(water.slope_pa_k, 0.0) << k;
    before_pa = water.pressure_pa;
    // The slope is the derivative, but for the step from ice to water.
    if (k > 181.0 && std::abs(k - kZero) > 1.0) {
      const double numeric =
          (saturation(k + 1e-3).pressure_pa - saturation(k - 1e-3).pressure_pa) / 2e-3;
      if (k < 399.0) {
        EXPECT_NEAR(water.slope_pa_k, numeric, 1e-4 * numeric + 1e-9) << k;
      }
    }
  }
}

TEST(Evaporation, PsychrometricConstantIsThatOfTheTable) {
  // FAO-56 annex 2, table 2.2, kPa/K by height; the table takes 2.45 MJ/kg, the heat at 20 to 22 C.
  for (const auto& [pressure_kpa, gamma] :
       {std::pair{101.3, 0.067}, std::pair{90.0, 0.060}, std::pair{81.8, 0.054}}) {
    EXPECT_NEAR(1e-3 * moist_air(kZero + 21.6, 1e3 * pressure_kpa, 1000.0).psychrometric_pa_k,
                gamma, 6e-4);
  }
}

TEST(Evaporation, WeatherGivesTheVapourOfTheAir) {
  std::vector<WeatherSample> rows(2);
  rows[0].air_k = 290.0;
  rows[0].relative_humidity_frac = 0.5;
  rows[1].sim_time_ns = 100;
  rows[1].air_k = 300.0;
  const double first_pa = 0.5 * saturation_over_water_pa(290.0);
  EXPECT_NEAR(with_vapour(forcing_from_rows(rows, 0), 280.0).vapour_pa, first_pa, 1e-9);
  // A row without humidity has the usual dew point; in between the share passes over.
  const double usual_pa = saturation_over_water_pa(280.0);
  EXPECT_NEAR(with_vapour(forcing_from_rows(rows, 100), 280.0).vapour_pa, usual_pa, 1e-9);
  EXPECT_NEAR(with_vapour(forcing_from_rows(rows, 50), 280.0).vapour_pa,
              0.5 * (first_pa + usual_pa), 1e-9);
  // Air holds no more than its saturation.
  EXPECT_NEAR(with_vapour(forcing_from_rows(rows, 100), 310.0).vapour_pa,
              saturation_over_water_pa(300.0), 1e-9);
}

/// Surface without heat conduction: a steady balance of what the air and the sky give.
double steady_k(const FosterDrive<double>& drive, double emissivity_frac) {
  FosterNetwork insulated;
  insulated.modes[0] = {1.0, 1e6};
  insulated.count = 1;
  const auto surface = foster_surface(insulated, emissivity_frac, kReferenceK, kReferenceK);
  FosterState<double> x{};
  const auto ladder = foster_ladder(1e6, insulated);
  for (int i = 0; i < 40; ++i) foster_advance(x, drive, drive, ladder, surface, 1e-6);
  return kReferenceK + foster_offset_k(x, surface);
}

FosterDrive<double> drive_of(double air_k, double film_w_m2_k, double absorbed_w_m2,
                             const MoistAir& air, const MoistSurface& surface) {
  FosterDrive<double> drive{.absorbed_w_m2 = absorbed_w_m2,
                            .film_w_m2_k = film_w_m2_k,
                            .air_offset_k = air_k - kReferenceK};
  add_moisture(surface, air, 1000.0, drive);
  return drive;
}

TEST(Evaporation, WetAdiabaticSurfaceTakesTheWetBulbTemperature) {
  struct Row {
    double air_c;
    double humidity_frac;
    double wet_bulb_c;
  };
  // Psychrometric tables at 101.3 kPa.
  for (const Row& row : {Row{10.0, 0.5, 5.5}, Row{20.0, 0.5, 13.8}, Row{25.0, 0.5, 17.9},
                         Row{30.0, 0.5, 22.0}, Row{20.0, 1.0, 20.0}}) {
    const double air_k = kZero + row.air_c;
    const MoistAir air =
        moist_air(air_k, 101'325.0, row.humidity_frac * saturation_over_water_pa(air_k));
    for (const double film_w_m2_k : {5.0, 20.0, 80.0}) {
      const double k =
          steady_k(drive_of(air_k, film_w_m2_k, 0.0, air, {.wetness_frac = 1.0}), 1e-12);
      EXPECT_NEAR(k - kZero, row.wet_bulb_c, 0.25) << row.air_c << " C, " << film_w_m2_k;
    }
  }
  // FAO-56 example 4: 25.6 C dry, 19.5 C wet at 1200 m (87.9 kPa) is a vapour pressure of 1.91 kPa.
  const double air_k = kZero + 25.6;
  const double k = steady_k(
      drive_of(air_k, 20.0, 0.0, moist_air(air_k, 87'900.0, 1910.0), {.wetness_frac = 1.0}), 1e-12);
  EXPECT_NEAR(k - kZero, 19.5, 0.1);
}

/// Evaporation by the closed form of Penman and Monteith (FAO-56 eq. 3), W/m2. The slope of the
/// saturation pressure is that at `slope_k`.
double penman_monteith_w_m2(double net_w_m2, double air_k, const MoistAir& air, double film_w_m2_k,
                            double resistance_s_m, double slope_pa_k) {
  const double aerodynamic_s_m = air.heat_j_m3_k / film_w_m2_k;
  const double deficit_pa = saturation(air_k).pressure_pa - air.vapour_pa;
  return (slope_pa_k * net_w_m2 + air.heat_j_m3_k * deficit_pa / aerodynamic_s_m) /
         (slope_pa_k + air.psychrometric_pa_k * (1.0 + resistance_s_m / aerodynamic_s_m));
}

TEST(Evaporation, SteadySurfaceEvaporatesAsPenmanAndMonteith) {
  double worst_frac = 0.0;
  double worst_at_air_frac = 0.0;
  std::size_t cases = 0;
  std::size_t cases_at_air = 0;
  for (const double resistance_s_m : {0.0, 50.0, 70.0, 200.0}) {
    for (const double air_c : {5.0, 15.0, 25.0, 35.0}) {
      for (const double humidity_frac : {0.2, 0.5, 0.8}) {
        for (const double film_w_m2_k : {10.0, 20.0, 40.0}) {
          for (const double sun_w_m2 : {0.0, 200.0, 500.0, 800.0}) {
            const double air_k = kZero + air_c;
            const MoistAir air =
                moist_air(air_k, 101'325.0, humidity_frac * saturation_over_water_pa(air_k));
            const double sky_w_m2 = 0.8 * kStefanBoltzmannWPerM2K4 * std::pow(air_k, 4.0);
            const auto drive = drive_of(air_k, film_w_m2_k, 0.77 * sun_w_m2 + sky_w_m2, air,
                                        {.wetness_frac = 1.0, .resistance_s_m = resistance_s_m});
            const double k = steady_k(drive, 1.0);
            const double latent_w_m2 = latent_flux(k, drive).flux_w_m2;
            const double net_w_m2 =
                drive.absorbed_w_m2 - kStefanBoltzmannWPerM2K4 * std::pow(k, 4.0);
            // The closed form has a straight line for the saturation pressure: that between air and
            // surface, or in FAO-56 the tangent at the air. Dew has no resistance.
            const auto closed_w_m2 = [&](double slope_pa_k) {
              return penman_monteith_w_m2(net_w_m2, air_k, air, film_w_m2_k,
                                          latent_w_m2 < 0.0 ? 0.0 : resistance_s_m, slope_pa_k);
            };
            SCOPED_TRACE(testing::Message()
                         << resistance_s_m << " s/m, " << air_c << " C, " << humidity_frac << ", "
                         << film_w_m2_k << " W/m2/K, " << sun_w_m2 << " W/m2");
            const double middle_w_m2 = closed_w_m2(saturation(0.5 * (k + air_k)).slope_pa_k);
            EXPECT_NEAR(latent_w_m2, middle_w_m2, 0.05 * std::abs(middle_w_m2) + 0.5);
            ++cases;
            if (std::abs(latent_w_m2) > 20.0) {
              worst_frac = std::max(worst_frac, std::abs(latent_w_m2 / middle_w_m2 - 1.0));
            }
            // The tangent at the air holds near the air alone.
            if (std::abs(k - air_k) > 2.0) continue;
            const double at_air_w_m2 = closed_w_m2(saturation(air_k).slope_pa_k);
            EXPECT_NEAR(latent_w_m2, at_air_w_m2, 0.05 * std::abs(at_air_w_m2) + 1.0);
            ++cases_at_air;
            if (std::abs(latent_w_m2) > 20.0) {
              worst_at_air_frac =
                  std::max(worst_at_air_frac, std::abs(latent_w_m2 / at_air_w_m2 - 1.0));
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(cases, 576U);
  EXPECT_GT(cases_at_air, 80U);
  RecordProperty("worst_percent", std::to_string(100.0 * worst_frac));
  RecordProperty("worst_at_air_percent", std::to_string(100.0 * worst_at_air_frac));
}

TEST(Evaporation, ReferenceGrassEvaporatesAsInTheExamplesOfFao56) {
  struct Example {
    double air_c;
    double vapour_kpa;
    double wind_m_s;     ///< at 2 m: the aerodynamic resistance is 208 s/m over it
    double net_mj_m2_h;  ///< net radiation less heat into the ground
    double pressure_kpa;
    double expected_mm_h;
  };
  // Example 18 (Uccle, 6 July, by the day: 16.9 C, 2.78 m/s at 10 m) and example 19 (N'Diaye, 1
  // October, 14 to 15 h).
  for (const Example& e : {Example{16.9, 1.409, 2.078, 13.28 / 24.0, 100.1, 3.88 / 24.0},
                           Example{38.0, 3.445, 3.3, 1.749 - 0.175, 101.2, 0.63}}) {
    const double air_k = kZero + e.air_c;
    const MoistAir air = moist_air(air_k, 1e3 * e.pressure_kpa, 1e3 * e.vapour_kpa);
    const double film_w_m2_k = air.heat_j_m3_k * e.wind_m_s / 208.0;
    const auto drive = drive_of(air_k, film_w_m2_k, e.net_mj_m2_h * 1e6 / 3600.0, air,
                                {.wetness_frac = 1.0, .resistance_s_m = 70.0});
    // Nothing is emitted: net radiation is given.
    const double latent_w_m2 = latent_flux(steady_k(drive, 1e-12), drive).flux_w_m2;
    const double mm_h = latent_w_m2 * 3600.0 / 2.45e6;
    EXPECT_NEAR(mm_h, e.expected_mm_h, 0.05 * e.expected_mm_h) << e.air_c;
    RecordProperty("mm_h_at_" + std::to_string(static_cast<int>(e.air_c)), std::to_string(mm_h));
  }
}

TEST(Evaporation, StomataCloseWithoutLightAndDewNeedsNone) {
  const MoistSurface grass{
      .wetness_frac = 1.0, .resistance_s_m = 70.0, .night_resistance_s_m = 200.0};
  EXPECT_DOUBLE_EQ(surface_resistance_s_m(grass, 0.0), 200.0);
  EXPECT_DOUBLE_EQ(surface_resistance_s_m(grass, kOpenStomataWM2), 70.0);
  EXPECT_DOUBLE_EQ(surface_resistance_s_m(grass, 900.0), 70.0);
  EXPECT_NEAR(surface_resistance_s_m(grass, 0.5 * kOpenStomataWM2),
              1.0 / (0.5 / 70.0 + 0.5 / 200.0), 1e-9);
  EXPECT_EQ(surface_resistance_s_m({.wetness_frac = 0.5}, 0.0), 0.0);
  FosterDrive<double> drive{.film_w_m2_k = 12.0};
  const MoistAir air = moist_air(283.15, 101'325.0, 1200.0);
  add_moisture(grass, air, 0.0, drive);
  // 12 W/m2/K is a resistance of 105 s/m: 200 s/m leave 34 % of the rate.
  EXPECT_NEAR(drive.evaporation_w_m2_pa / drive.dew_w_m2_pa, 105.0 / 305.0, 2e-3);
  EXPECT_NEAR(drive.dew_w_m2_pa, 12.0 / 66.0, 0.002);
  EXPECT_GT(latent_flux(285.0, drive).flux_w_m2, 0.0);
  EXPECT_LT(latent_flux(279.0, drive).flux_w_m2, 0.0);
  // Half of the wetness is half of the evaporation, and a dry surface has none.
  FosterDrive<double> half{.film_w_m2_k = 12.0};
  add_moisture({.wetness_frac = 0.5, .resistance_s_m = 70.0, .night_resistance_s_m = 200.0}, air,
               0.0, half);
  EXPECT_NEAR(half.evaporation_w_m2_pa, 0.5 * drive.evaporation_w_m2_pa, 1e-15);
  FosterDrive<double> dry{.film_w_m2_k = 12.0};
  add_moisture({}, air, 500.0, dry);
  EXPECT_EQ(latent_flux(320.0, dry).flux_w_m2, 0.0);
}

/// Extreme weather and surfaces for one step.
struct Extreme {
  FosterNetwork network;
  FosterSurface<double> surface;
  FosterState<double> x{};
  FosterDrive<double> begin;
  FosterDrive<double> end;
  double dt_s = 0.0;
};
Extreme extreme(std::mt19937& random) {
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  Extreme out;
  out.network.modes[0] = {between(1.0, 1e3), between(1e-3, 0.1)};
  out.network.modes[1] = {between(1e3, 1e5), between(1e-2, 2.0)};
  out.network.count = 2;
  out.surface = foster_surface(out.network, between(0.1, 1.0), between(250.0, 320.0), kReferenceK);
  const double start_k = between(230.0, 370.0);
  out.x = foster_steady(
      (start_k - kReferenceK - out.surface.base_offset_k) / out.network.resistance_m2k_w(),
      out.surface);
  const MoistSurface moisture{.wetness_frac = between(0.1, 1.0),
                              .resistance_s_m = std::max(0.0, between(-100.0, 300.0))};
  const double air_k = between(230.0, 320.0);
  out.begin = drive_of(
      air_k, between(1.0, 100.0), between(100.0, 1500.0),
      moist_air(air_k, 101'325.0, between(0.0, 1.0) * saturation_over_water_pa(air_k)), moisture);
  out.end = out.begin;
  out.dt_s = std::pow(10.0, between(-1.0, 6.0));
  return out;
}

TEST(Evaporation, ExtremeStepsStayBetweenTheColdestAndTheDryBalance) {
  std::mt19937 random(7);
  for (int i = 0; i < 20'000; ++i) {
    Extreme e = extreme(random);
    const double start_k = kReferenceK + foster_offset_k(e.x, e.surface);
    const auto ladder = foster_ladder(e.dt_s, e.network);
    foster_advance(e.x, e.begin, e.end, ladder, e.surface, 0.01);
    const double k = kReferenceK + foster_offset_k(e.x, e.surface);
    ASSERT_TRUE(std::isfinite(k)) << i;
    // The balance of the dry surface alone is the warmest that can come, and that with all of the
    // water is the coldest.
    const auto balance_k = [&](const FosterDrive<double>& drive) {
      double low = 100.0;
      double high = 500.0;
      for (int n = 0; n < 60; ++n) {
        const double middle = 0.5 * (low + high);
        (foster_flux_w_m2(middle - kReferenceK, drive, e.surface) > 0.0 ? low : high) = middle;
      }
      return 0.5 * (low + high);
    };
    FosterDrive<double> dry = e.begin;
    dry.evaporation_w_m2_pa = dry.dew_w_m2_pa = 0.0;
    const double base_k = kReferenceK + e.surface.base_offset_k;
    const double wet_k = balance_k(e.begin);
    const double low_k = std::min({start_k, base_k, wet_k});
    const double high_k = std::max({start_k, base_k, wet_k, balance_k(dry)});
    ASSERT_GT(k, low_k - 0.1) << i << ", start " << start_k << ", " << e.dt_s << " s";
    ASSERT_LT(k, high_k + 0.1) << i << ", start " << start_k << ", " << e.dt_s << " s";
  }
}

TEST(Evaporation, SingleStepsOfAnyLengthStayFinite) {
  std::mt19937 random(11);
  for (int i = 0; i < 20'000; ++i) {
    Extreme e = extreme(random);
    foster_step(e.x, e.begin, e.end, foster_gains(e.dt_s, e.network), e.surface);
    const double k = kReferenceK + foster_offset_k(e.x, e.surface);
    ASSERT_TRUE(std::isfinite(k) && k > 0.0 && k < 600.0) << i << ": " << k;
  }
}

TEST(Evaporation, SplittingAStepConvergesInTheSecondOrder) {
  FosterNetwork network;
  network.modes[0] = {300.0, 0.02};
  network.modes[1] = {2e4, 0.3};
  network.count = 2;
  const auto surface = foster_surface(network, 0.97, 288.0, kReferenceK);
  const auto at = [&](double f) {
    return drive_of(290.0 + 6.0 * f, 15.0, 350.0 + 600.0 * f, moist_air(293.0, 1e5, 1300.0),
                    {.wetness_frac = 1.0, .resistance_s_m = 50.0});
  };
  const auto run = [&](int parts) {
    FosterState<double> x{};
    const auto gains = foster_gains(3600.0 / parts, network);
    for (int i = 0; i < parts; ++i) {
      foster_step(x, lerp(at(0.0), at(1.0), static_cast<double>(i) / parts),
                  lerp(at(0.0), at(1.0), (i + 1.0) / parts), gains, surface);
    }
    return foster_offset_k(x, surface);
  };
  const double truth_k = run(4096);
  const double coarse_k = std::abs(run(32) - truth_k);
  const double fine_k = std::abs(run(256) - truth_k);
  EXPECT_LT(coarse_k, 0.002);
  EXPECT_GT(std::log2(coarse_k / fine_k) / 3.0, 1.6);
}

TEST(Evaporation, LanesHaveTheBitsOfSingleSurfaces) {
  std::mt19937 random(5);
  for (int round = 0; round < 50; ++round) {
    std::array<Extreme, kFosterLanes> each;
    std::array<FosterState<double>, kFosterLanes> together;
    std::array<FosterLadder, kFosterLanes> ladders;
    std::vector<FosterLane> lanes;
    for (std::size_t l = 0; l < kFosterLanes; ++l) {
      each[l] = extreme(random);
      // A dry one among moist ones keeps its bits too.
      if (l % 3 == 0) {
        for (FosterDrive<double>* drive : {&each[l].begin, &each[l].end}) {
          drive->evaporation_w_m2_pa = drive->dew_w_m2_pa = drive->vapour_pa = 0.0;
        }
      }
      together[l] = each[l].x;
      ladders[l] = foster_ladder(each[l].dt_s, each[l].network);
    }
    for (std::size_t l = 0; l < kFosterLanes; ++l) {
      lanes.push_back({&together[l], each[l].begin, each[l].end, &ladders[l], each[l].surface});
    }
    foster_advance_all(lanes, 0.01);
    for (std::size_t l = 0; l < kFosterLanes; ++l) {
      foster_advance(each[l].x, each[l].begin, each[l].end, ladders[l], each[l].surface, 0.01);
      for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
        ASSERT_EQ(each[l].x[i], together[l][i]) << "lane " << l << ", round " << round;
      }
    }
  }
}

}  // namespace
}  // namespace emit::physics
