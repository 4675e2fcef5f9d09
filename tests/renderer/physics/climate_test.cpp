// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/climate/climate.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace emit::physics {
namespace {

constexpr double kYearS = 365.2425 * 86'400.0;
constexpr std::int64_t kNewYear2015Ns = 1'420'070'400'000'000'000;

GeoPlace place(double latitude_deg, double height_m) {
  return {Radians(latitude_deg * std::numbers::pi / 180.0), Radians(0.0), Metres(height_m)};
}

TEST(Climate, day_of_year_counts_from_new_year) {
  EXPECT_DOUBLE_EQ(day_of_year(kNewYear2015Ns), 0.0);
  EXPECT_DOUBLE_EQ(day_of_year(kNewYear2015Ns + 31 * 86'400'000'000'000 + 43'200'000'000'000),
                   31.5);
  EXPECT_DOUBLE_EQ(day_of_year(kNewYear2015Ns - 86'400'000'000'000), 364.0);
}

// Mean, first harmonic and its warmest day of the air in typical years (TMY, TMY3 and IWEC files).
// Every place differs from the means along its parallel; the header states by how much.
TEST(Climate, differs_from_typical_years_by_what_the_header_states) {
  struct Station {
    double latitude_deg, height_m, mean_c, amplitude_k, warmest_day;
  };
  constexpr std::array<Station, 11> kStations{{{39.8, 1650, 10.9, 12.2, 201},   // Denver
                                               {33.6, 308, 16.7, 10.5, 195},    // Atlanta
                                               {71.3, 10, -11.8, 16.0, 209},    // Barrow
                                               {52.3, -2, 10.0, 6.9, 204},      // Amsterdam
                                               {42.0, 201, 10.0, 14.2, 200},    // Chicago
                                               {33.8, 12, 17.2, 4.3, 217},      // Long Beach
                                               {34.2, 235, 18.6, 6.8, 220},     // Van Nuys
                                               {49.5, 96, 12.4, 9.2, 199},      // Mannheim
                                               {45.0, 250, 13.6, 9.6, 199},     // Piedmont
                                               {35.7, 6, 16.7, 10.7, 211},      // Tokyo
                                               {33.4, 337, 23.8, 11.9, 205}}};  // Phoenix
  double mean_square = 0.0;
  double amplitude_square = 0.0;
  for (const Station& station : kStations) {
    SCOPED_TRACE(station.latitude_deg);
    const AnnualAir air = zonal_climate(place(station.latitude_deg, station.height_m));
    const double mean_k = air.mean_k - 273.15 - station.mean_c;
    const double amplitude_k = air.amplitude_k - station.amplitude_k;
    EXPECT_LT(std::abs(mean_k), 7.15);
    EXPECT_LT(std::abs(amplitude_k), 6.35);
    EXPECT_NEAR(air.warmest_day, station.warmest_day, 19.5);
    mean_square += mean_k * mean_k / kStations.size();
    amplitude_square += amplitude_k * amplitude_k / kStations.size();
  }
  EXPECT_NEAR(std::sqrt(mean_square), 4.0, 0.1);
  EXPECT_NEAR(std::sqrt(amplitude_square), 3.4, 0.1);
}

TEST(Climate, of_a_table_is_its_annual_wave_whatever_its_days_do) {
  const AnnualAir truth{.mean_k = 281.0, .amplitude_k = 9.0, .warmest_day = 204.0};
  std::vector<WeatherSample> rows;
  const std::int64_t epoch_ns = kNewYear2015Ns + 100 * 86'400'000'000'000;
  for (int hour = -2000; hour < 6760; ++hour) {
    if (hour % 7 == 3) continue;  // rows need not lie evenly
    WeatherSample& row = rows.emplace_back();
    row.sim_time_ns = hour * 3'600'000'000'000;
    row.air_k = truth.at_k(day_of_year(epoch_ns + row.sim_time_ns)) +
                6.0 * std::cos(2.0 * std::numbers::pi * hour / 24.0);
  }
  const auto found = annual_air_of(rows, epoch_ns);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(found->mean_k, truth.mean_k, 0.02);
  EXPECT_NEAR(found->amplitude_k, truth.amplitude_k, 0.02);
  EXPECT_NEAR(found->warmest_day, truth.warmest_day, 0.2);
  rows.resize(rows.size() / 2);
  EXPECT_FALSE(annual_air_of(rows, epoch_ns).has_value());
}

// Explicit finite differences over 20 m of ground and 20 years know nothing of damping depths.
TEST(Climate, ground_follows_the_air_as_conduction_has_it) {
  const AnnualAir air{.mean_k = 280.0, .amplitude_k = 12.0, .warmest_day = 200.0};
  constexpr double kCellM = 0.1;
  constexpr std::size_t kCells = 200;
  constexpr double kStepS = 3600.0;
  for (const double conductivity_w_m_k : {0.5, 2.0}) {
    const StackLayer ground{2.0, conductivity_w_m_k, 2.0e6};
    const double ratio = conductivity_w_m_k / 2.0e6 * kStepS / (kCellM * kCellM);
    std::vector<double> k(kCells + 1, air.mean_k);
    double worst_k = 0.0;
    for (double t_s = 0.0; t_s < 20.0 * kYearS; t_s += kStepS) {
      const double day = std::fmod(t_s, kYearS) / 86'400.0;
      std::vector<double>& now = k;
      double left = now[0] = air.at_k(day);
      for (std::size_t i = 1; i < kCells; ++i) {
        const double own = now[i];
        now[i] += ratio * (left - 2.0 * own + now[i + 1]);
        left = own;
      }
      if (t_s > 19.0 * kYearS) {
        worst_k = std::max(worst_k, std::abs(now[20] - ground_k(air, {&ground, 1}, day)));
      }
    }
    EXPECT_LT(worst_k, 0.05);
  }
}

TEST(Climate, usual_dew_point_is_that_of_60_percent) {
  EXPECT_NEAR(usual_dew_point_k(293.15), 285.15, 0.1);  // psychrometric tables: 12.0 C
  EXPECT_NEAR(usual_dew_point_k(273.15), 266.4, 0.3);   // over water: -6.8 C
}

}  // namespace
}  // namespace emit::physics
