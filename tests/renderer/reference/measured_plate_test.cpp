// SPDX-License-Identifier: Apache-2.0
// Level ground under measured weather, and fits to a logger.
#include "emit/reference/measured_plate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "emit/physics/air_film.hpp"
#include "emit/physics/climate/gusts.hpp"
#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

using ::testing::HasSubstr;

constexpr std::array<PlateNumber, 4> kAll{PlateNumber::absorptance, PlateNumber::inertia,
                                          PlateNumber::film, PlateNumber::base};

PlateSetup soil() {
  PlateSetup setup;
  setup.layers = {{0.1, 0.5, 1500.0, 1000.0}, {0.9, 1.2, 1800.0, 1100.0}};
  setup.height_m = 500.0;
  return setup;
}

/// A clear day with a row every `step_s`, and gusts that repeat exactly.
std::vector<LoggerRow> clear_day(double step_s, double hours = 24.0) {
  std::vector<LoggerRow> rows;
  for (double t_s = 0.0; t_s <= hours * 3600.0; t_s += step_s) {
    const double phase = 2.0 * std::numbers::pi * t_s / 86'400.0;
    LoggerRow row;
    row.time_s = t_s;
    row.sun_w_m2 = std::max(0.0, 900.0 * std::sin(phase - 0.25 * std::numbers::pi));
    row.longwave_down_w_m2 = 300.0 + 20.0 * std::sin(phase - 1.2);
    row.air_k = 290.0 + 6.0 * std::sin(phase - 1.4);
    row.wind_m_s = 2.5 + 1.5 * std::sin(phase) + 0.6 * std::sin(23.0 * phase);
    rows.push_back(row);
  }
  return rows;
}

/// Fills the measured temperature: the model of `truth` with noise.
void measure(const PlateSetup& setup, const PlateNumbers& truth, double noise_k, unsigned seed,
             std::vector<LoggerRow>& rows) {
  const auto history_k = plate_history_k(setup, rows, truth);
  ASSERT_TRUE(history_k) << history_k.error().text;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, noise_k);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].surface_k = (*history_k)[i] + noise(random);
  }
}

TEST(MeasuredPlate, constant_weather_ends_in_balance) {
  std::vector<LoggerRow> rows = clear_day(1800.0);
  for (LoggerRow& row : rows) {
    row.sun_w_m2 = 400.0;
    row.longwave_down_w_m2 = 320.0;
    row.air_k = 290.0;
    row.wind_m_s = 3.0;
  }
  PlateSetup setup = soil();
  setup.layers = {{0.02, 0.5, 1500.0, 1000.0}};  // settles within the day
  const PlateNumbers numbers{.absorptance_frac = 0.7,
                             .inertia_factor = 1.3,
                             .film_factor = 0.8,
                             .base_k = 285.0,
                             .emissivity_frac = 0.94};
  const auto history_k = plate_history_k(setup, rows, numbers);
  ASSERT_TRUE(history_k) << history_k.error().text;
  // Find by bisection the face at which all fluxes are in balance.
  physics::AirFlow flow;
  flow.air_k = 290.0;
  flow.pressure_pa = physics::standard_pressure_pa(setup.height_m);
  flow.undirected_m_s =
      std::hypot(3.0, physics::convective_gust_m_s({400.0, 320.0, 290.0, flow.pressure_pa}));
  const physics::AirFilm film = physics::air_film(flow);
  double low_k = 250.0;
  double high_k = 350.0;
  for (int i = 0; i < 60; ++i) {
    const double face_k = 0.5 * (low_k + high_k);
    const double film_w_m2_k =
        0.8 * physics::film_w_m2_k(film, {0.0, 0.0, 1.0}, setup.skin, face_k - 290.0);
    const double flux_w_m2 = 0.7 * 400.0 + 0.94 * 320.0 -
                             0.94 * physics::kStefanBoltzmannWPerM2K4 * std::pow(face_k, 4.0) -
                             film_w_m2_k * (face_k - 290.0) - 1.3 * 0.5 / 0.02 * (face_k - 285.0);
    (flux_w_m2 > 0.0 ? low_k : high_k) = face_k;
  }
  EXPECT_NEAR(history_k->back(), low_k, 1e-3);
}

TEST(MeasuredPlate, halved_rows_give_the_same_history) {
  const auto coarse = plate_history_k(soil(), clear_day(600.0), {.absorptance_frac = 0.7});
  const auto fine = plate_history_k(soil(), clear_day(300.0), {.absorptance_frac = 0.7});
  ASSERT_TRUE(coarse && fine);
  for (std::size_t i = 0; i < coarse->size(); ++i) {
    EXPECT_NEAR((*coarse)[i], (*fine)[2 * i], 0.05) << i;
  }
}

/// Outcome of fits to the same ground with other noise.
struct Coverage {
  int within = 0;      ///< fits in which all numbers lie within their interval
  double width = 0.0;  ///< of the widest interval of a fit over its number, mean
};

/// Fits all numbers `runs` times. `memory` is the correlation of the noise of two rows, which stand
/// 10 min apart.
Coverage coverage_of(int runs, double memory) {
  const PlateSetup setup = soil();
  const PlateNumbers truth{.absorptance_frac = 0.82,
                           .inertia_factor = 0.7,
                           .film_factor = 1.25,
                           .base_k = 283.0,
                           .emissivity_frac = 0.95};
  const PlateNumbers start{.absorptance_frac = 0.6, .base_k = 288.0, .emissivity_frac = 0.95};
  constexpr double kNoiseK = 0.5;
  const std::vector<LoggerRow> day = clear_day(600.0);
  const auto truth_k = plate_history_k(setup, day, truth);
  EXPECT_TRUE(truth_k);
  Coverage out;
  for (int run = 0; run < runs; ++run) {
    std::vector<LoggerRow> rows = day;
    std::mt19937 random(17U + static_cast<unsigned>(run));
    std::normal_distribution<double> noise(0.0, kNoiseK);
    double error_k = noise(random);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i].surface_k = (*truth_k)[i] + error_k;
      error_k = memory * error_k + std::sqrt(1.0 - memory * memory) * noise(random);
    }
    const auto fit = fit_plate(setup, rows, start, kAll);
    EXPECT_TRUE(fit) << fit.error().text;
    if (!fit) return out;
    EXPECT_TRUE(fit->converged);
    bool all = true;
    double widest = 0.0;
    PlateNumbers copy = truth;
    for (const PlateEstimate& estimate : fit->estimates) {
      const double known = value_of(copy, estimate.number);
      all = all && known >= estimate.low && known <= estimate.high;
      widest = std::max(widest, (estimate.high - estimate.low) / known);
    }
    out.within += all ? 1 : 0;
    out.width += widest / runs;
  }
  return out;
}

TEST(MeasuredPlate, fit_recovers_known_numbers_within_its_interval) {
  const Coverage coverage = coverage_of(100, 0.0);
  EXPECT_GE(coverage.within, 95);
  // An interval as wide as its number would say nothing.
  EXPECT_LT(coverage.width, 0.8);
}

TEST(MeasuredPlate, interval_holds_for_noise_with_a_memory) {
  // 0.7 over 10 min is a correlation time of 57 min.
  EXPECT_GE(coverage_of(100, 0.7).within, 95);
}

TEST(MeasuredPlate, correlated_noise_widens_the_interval) {
  const PlateSetup setup = soil();
  const PlateNumbers truth{.absorptance_frac = 0.8, .base_k = 284.0};
  const std::array<PlateNumber, 2> free{PlateNumber::inertia, PlateNumber::base};
  std::array<double, 2> width_k{};
  for (const int kind : {0, 1}) {
    std::vector<LoggerRow> rows = clear_day(300.0);
    measure(setup, truth, 0.0, 1, rows);
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0.0, 0.5);
    const double memory = kind == 0 ? 0.0 : 0.95;
    double error_k = 0.0;
    for (LoggerRow& row : rows) {
      error_k = memory * error_k + std::sqrt(1.0 - memory * memory) * noise(random);
      row.surface_k += error_k;
    }
    const auto fit = fit_plate(setup, rows, truth, free);
    ASSERT_TRUE(fit) << fit.error().text;
    width_k[static_cast<std::size_t>(kind)] = fit->estimates[1].high - fit->estimates[1].low;
    EXPECT_LE(fit->estimates[1].low, 284.0);
    EXPECT_GE(fit->estimates[1].high, 284.0);
  }
  // A memory of 0.95 has a correlation time of 39 rows: six times the width.
  EXPECT_GT(width_k[1], 3.0 * width_k[0]);
}

TEST(MeasuredPlate, stated_film_takes_the_place_of_the_wind) {
  std::vector<LoggerRow> rows = clear_day(1800.0);
  PlateSetup setup = soil();
  setup.layers = {{0.02, 0.5, 1500.0, 1000.0}};
  for (LoggerRow& row : rows) {
    row.sun_w_m2 = 0.0;
    row.longwave_down_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(290.0, 4.0);
    row.air_k = 310.0;
    row.film_w_m2_k = 12.0;
  }
  const auto history_k = plate_history_k(
      setup, rows,
      {.absorptance_frac = 0.5, .film_factor = 1.5, .base_k = 290.0, .emissivity_frac = 1e-6});
  ASSERT_TRUE(history_k) << history_k.error().text;
  // The film of 18 and the layer of 25 W m-2 K-1 stand in series between 310 and 290 K.
  EXPECT_NEAR(history_k->back(), 290.0 + 20.0 * 18.0 / 43.0, 1e-3);
}

TEST(MeasuredPlate, ground_loses_the_measured_evaporation) {
  std::vector<LoggerRow> rows = clear_day(1800.0);
  PlateSetup setup = soil();
  setup.layers = {{0.02, 0.5, 1500.0, 1000.0}};  // 25 W m-2 K-1, settles within the day
  for (LoggerRow& row : rows) {
    row.sun_w_m2 = 600.0;
    row.longwave_down_w_m2 = 0.0;
    row.air_k = 290.0;
    row.film_w_m2_k = 15.0;
    row.evaporation_w_m2 = 100.0;
  }
  const auto history_k = plate_history_k(
      setup, rows, {.absorptance_frac = 0.5, .base_k = 290.0, .emissivity_frac = 1e-6});
  ASSERT_TRUE(history_k) << history_k.error().text;
  // The face absorbs 300 W/m2, and 200 of them pass the film and the layer side by side.
  EXPECT_NEAR(history_k->back(), 290.0 + 200.0 / 40.0, 1e-3);
}

TEST(MeasuredPlate, heat_into_the_ground_closes_the_balance_of_the_model) {
  const PlateSetup setup = soil();
  const PlateNumbers numbers{.absorptance_frac = 0.75, .base_k = 286.0};
  std::vector<LoggerRow> rows = clear_day(300.0);
  measure(setup, numbers, 0.0, 1, rows);
  const auto ground = ground_heat_w_m2(setup, rows, numbers);
  ASSERT_TRUE(ground) << ground.error().text;
  const std::vector<double> films = measured_films_w_m2_k(setup, rows, numbers);
  for (std::size_t i = 12; i < rows.size(); ++i) {
    const auto into = [&](std::size_t j) {
      return numbers.absorptance_frac * rows[j].sun_w_m2 +
             numbers.emissivity_frac *
                 (rows[j].longwave_down_w_m2 -
                  physics::kStefanBoltzmannWPerM2K4 * std::pow(rows[j].surface_k, 4.0)) -
             films[j] * (rows[j].surface_k - rows[j].air_k);
    };
    EXPECT_NEAR((*ground)[i], 0.5 * (into(i - 1) + into(i)), 2.0) << i;
  }
}

TEST(MeasuredPlate, refuses_what_cannot_be_fitted) {
  const PlateSetup setup = soil();
  std::vector<LoggerRow> rows = clear_day(600.0);
  const auto short_record = fit_plate(setup, std::span(rows).first(60), {}, kAll);
  ASSERT_FALSE(short_record);
  EXPECT_THAT(short_record.error().text, HasSubstr("9.8 h"));
  std::swap(rows[3].time_s, rows[4].time_s);
  const auto unsorted = fit_plate(setup, rows, {}, kAll);
  ASSERT_FALSE(unsorted);
  EXPECT_THAT(unsorted.error().text, HasSubstr("row 5"));
  rows = clear_day(600.0);
  for (LoggerRow& row : rows) row.sun_w_m2 = 0.0;
  measure(setup, {.absorptance_frac = 0.5}, 0.1, 1, rows);
  const auto dark = fit_plate(setup, rows, {.absorptance_frac = 0.5}, kAll);
  ASSERT_FALSE(dark);
  EXPECT_THAT(dark.error().text, HasSubstr("absorptance"));
  EXPECT_FALSE(plate_history_k(setup, rows, {.absorptance_frac = 1.2}));
  EXPECT_FALSE(fit_plate(setup, rows, {}, {}));
}

}  // namespace
}  // namespace emit::reference
