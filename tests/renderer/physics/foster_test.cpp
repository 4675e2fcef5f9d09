// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/foster.hpp"
#include "emit/physics/constants.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace emit::physics {
namespace {

const std::vector<StackLayer> kRoad = {{0.15, 0.7, 1.95e6}, {0.3, 1.5, 1.9e6}, {1.55, 1.2, 2.2e6}};
const std::vector<StackLayer> kThickConcrete = {{0.5, 1.7, 2.02e6}};
const std::vector<StackLayer> kSheet = {{0.001, 45.0, 3.69e6}, {0.02, 0.16, 1.2e3}};

FosterNetwork network(const std::vector<StackLayer>& layers, std::size_t modes) {
  auto result = network_of_stack(layers, {.modes = modes});
  EXPECT_TRUE(result.has_value());
  return result.value_or(FosterNetwork{});
}

/// Returns the drive of a summer morning on asphalt. The sun rises over three and a half hours,
/// with shade during a part of them.
FosterDrive<double> morning(double t_s, bool lit) {
  const double sun_w_m2 = lit ? 0.75 * (273.0 + 448.0 * t_s / 12600.0) : 0.0;
  return {.absorbed_w_m2 = sun_w_m2 + 60.0 + 0.93 * 330.0,
          .film_w_m2_k = 13.3,
          .air_offset_k = -3.5 + 5.3 * t_s / 12600.0};
}

struct Interval {
  double begin_s;
  double end_s;
  bool lit;
};

/// Returns the intervals of a history in which two shadows pass. They grow into the past like those
/// of the renderer.
std::vector<Interval> intervals() {
  return {{0, 1800, true},      {1800, 4500, true},  {4500, 6300, false},  {6300, 8100, true},
          {8100, 9000, false},  {9000, 10800, true}, {10800, 11700, true}, {11700, 12300, true},
          {12300, 12580, true}, {12580, 12600, true}};
}

FosterState<double> steady_start(const FosterNetwork& n, const FosterSurface<double>& surface) {
  return foster_steady((-4.0 - surface.base_offset_k) / n.resistance_m2k_w(), surface);
}

double run_split(const FosterNetwork& n, int splits) {
  const auto surface = foster_surface(n, 0.93, 286.15, kReferenceK);
  FosterState<double> x = steady_start(n, surface);
  for (const Interval& interval : intervals()) {
    const auto gains = foster_gains((interval.end_s - interval.begin_s) / splits, n);
    const auto begin = morning(interval.begin_s, interval.lit);
    const auto end = morning(interval.end_s, interval.lit);
    for (int i = 0; i < splits; ++i) {
      foster_step(x, lerp(begin, end, static_cast<double>(i) / splits),
                  lerp(begin, end, (i + 1.0) / splits), gains, surface);
    }
  }
  return foster_offset_k(x, surface);
}

double run_controlled(const FosterNetwork& n, double tolerance_k, double* worst_estimate_k,
                      int* steps) {
  const auto surface = foster_surface(n, 0.93, 286.15, kReferenceK);
  FosterState<double> x = steady_start(n, surface);
  *worst_estimate_k = 0.0;
  *steps = 0;
  for (const Interval& interval : intervals()) {
    const auto ladder = foster_ladder(interval.end_s - interval.begin_s, n);
    const auto done =
        foster_advance(x, morning(interval.begin_s, interval.lit),
                       morning(interval.end_s, interval.lit), ladder, surface, tolerance_k);
    *worst_estimate_k = std::max(*worst_estimate_k, done.error_k);
    *steps += (2 << done.level) - 1;
  }
  return foster_offset_k(x, surface);
}

TEST(FosterNetwork, ImpedanceOfAHomogeneousSlabIsTheClosedForm) {
  const double angular = 2.0 * kPi / 86400.0;
  const std::complex<double> g = std::sqrt(std::complex<double>(0.0, angular * 2.02e6 / 1.7));
  const auto expected = std::tanh(g * 0.5) / (1.7 * g);
  EXPECT_NEAR(std::abs(stack_impedance_m2k_w(kThickConcrete, angular) - expected), 0.0, 1e-14);
  // A cut into two layers of the same material changes nothing. At rest the impedance is the
  // resistance.
  const std::vector<StackLayer> cut = {{0.2, 1.7, 2.02e6}, {0.3, 1.7, 2.02e6}};
  EXPECT_NEAR(std::abs(stack_impedance_m2k_w(cut, angular) - expected), 0.0, 1e-14);
  EXPECT_NEAR(stack_impedance_m2k_w(kThickConcrete, 0.0).real(), 0.5 / 1.7, 1e-14);
}

TEST(FosterNetwork, ModesAreStableOrderedAndKeepTheResistanceForEveryStack) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto log_between = [&](double lo, double hi) { return lo * std::pow(hi / lo, unit(rng)); };
  for (int n = 0; n < 20; ++n) {
    std::vector<StackLayer> layers;
    double resistance = 0.0;
    const int count = 1 + n % 4;
    for (int i = 0; i < count; ++i) {
      layers.push_back({log_between(1e-4, 1.0), log_between(0.02, 400.0), log_between(1e3, 4.2e6)});
      resistance += layers.back().thickness_m / layers.back().conductivity_w_m_k;
    }
    for (std::size_t modes = 1; modes <= kMaxFosterModes; ++modes) {
      const auto result = network_of_stack(layers, {.modes = modes});
      ASSERT_TRUE(result) << result.error().text;
      ASSERT_GE(result->count, 1U);
      ASSERT_LE(result->count, modes);
      EXPECT_NEAR(result->resistance_m2k_w() / resistance, 1.0, 1e-12);
      double before_s = 0.0;
      for (std::size_t i = 0; i < result->count; ++i) {
        EXPECT_GT(result->modes[i].tau_s, before_s);
        EXPECT_GT(result->modes[i].resistance_m2k_w, 0.0);
        before_s = result->modes[i].tau_s;
      }
    }
  }
}

TEST(FosterNetwork, MoreModesComeCloserToTheStack) {
  for (const auto* layers : {&kRoad, &kThickConcrete}) {
    double before = std::numeric_limits<double>::infinity();
    for (std::size_t modes = 1; modes <= kMaxFosterModes; ++modes) {
      const FosterNetwork n = network(*layers, modes);
      double sum = 0.0;
      for (int i = 0; i < 50; ++i) {
        const double angular = 2.0 * kPi / (100.0 * std::pow(8640.0, i / 49.0));
        const auto z = stack_impedance_m2k_w(*layers, angular);
        sum += std::norm((network_impedance_m2k_w(n, angular) - z) / (1.0 + 19.0 * z));
      }
      const double rms = std::sqrt(sum / 50);
      RecordProperty("impedance_rms_" + std::to_string(modes), std::to_string(rms));
      EXPECT_LT(rms, 0.6 * before) << modes;
      before = rms;
    }
    // The bound is in kelvin per W/m2 of drive: 500 W/m2 of sun give less than 0.5 K.
    EXPECT_LT(before, 1e-3);
  }
}

/// Thick ground under sun that comes all at once and a film: the closed form of a half-space
/// (Carslaw and Jaeger, Conduction of Heat in Solids, 2.7 (1)), from dry peat to granite.
TEST(FosterNetwork, ThickGroundWarmsAsAHalfSpaceDoes) {
  constexpr double kSunWM2 = 600.0;
  constexpr double kFilmWM2K = 19.0;
  struct Ground {
    double conductivity_w_m_k;
    double heat_j_m3_k;
  };
  double worst_k = 0.0;
  for (const Ground& ground : {Ground{0.1, 0.6e6}, Ground{0.3, 1.3e6}, Ground{0.75, 1.95e6},
                               Ground{1.7, 2.0e6}, Ground{2.8, 2.3e6}}) {
    const std::vector<StackLayer> layers = {{4.0, ground.conductivity_w_m_k, ground.heat_j_m3_k}};
    const FosterNetwork n = network(layers, kMaxFosterModes);
    // The surface emits nothing, so that its balance is linear as in the closed form.
    const auto surface = foster_surface(n, 0.0, kReferenceK, kReferenceK);
    const FosterDrive<double> drive{.absorbed_w_m2 = kSunWM2, .film_w_m2_k = kFilmWM2K};
    const double per_root_s = kFilmWM2K / std::sqrt(ground.conductivity_w_m_k * ground.heat_j_m3_k);
    FosterState<double> x{};
    double now_s = 0.0;
    for (double next_s = 30.0; next_s < 50'000.0; next_s *= 1.25) {
      foster_advance(x, drive, drive, foster_ladder(next_s - now_s, n), surface, 1e-4);
      now_s = next_s;
      const double way = per_root_s * std::sqrt(now_s);
      const double expected_k = kSunWM2 / kFilmWM2K * (1.0 - std::exp(way * way) * std::erfc(way));
      const double error_k = foster_offset_k(x, surface) - expected_k;
      worst_k = std::max(worst_k, std::abs(error_k));
      EXPECT_NEAR(error_k, 0.0, 0.2) << ground.conductivity_w_m_k << ", " << now_s << " s";
    }
  }
  RecordProperty("worst_k", std::to_string(worst_k));
}

TEST(FosterNetwork, ASheetOverAFilmIsOneModeOfItsHeatAndItsFilm) {
  const FosterNetwork n = network(kSheet, 4);
  double mean_tau_s = 0.0;
  for (std::size_t i = 0; i < n.count; ++i) {
    mean_tau_s += n.modes[i].tau_s * n.modes[i].resistance_m2k_w / n.resistance_m2k_w();
  }
  const double heat = 0.001 * 3.69e6;
  EXPECT_NEAR(mean_tau_s, heat * 0.125, 0.02 * heat * 0.125);
}

TEST(FosterNetwork, RefusesLayersThatAreNone) {
  EXPECT_FALSE(network_of_stack({}));
  const std::vector<StackLayer> bad = {{0.1, 0.0, 1e6}};
  EXPECT_FALSE(network_of_stack(bad));
  EXPECT_FALSE(network_of_stack(kRoad, {.modes = kMaxFosterModes + 1}));
}

TEST(FosterStep, LadderOfDoubledGainsEqualsGainsOfEachStep) {
  const FosterNetwork n = network(kRoad, 4);
  for (const double dt_s : {1e-6, 1.0, 1800.0, 1e7}) {
    const FosterLadder ladder = foster_ladder(dt_s, n);
    for (std::size_t level = 0; level < ladder.level.size(); ++level) {
      const auto direct = foster_gains(dt_s / static_cast<double>(1 << level), n);
      for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
        EXPECT_NEAR(ladder.level[level].start_frac[i], direct.start_frac[i],
                    1e-13 * direct.start_frac[i] + 1e-15);
        EXPECT_NEAR(ladder.level[level].end_frac[i], direct.end_frac[i],
                    1e-13 * direct.end_frac[i]);
      }
    }
  }
}

TEST(FosterStep, SteadyStateIsTheEquilibriumOverTheWholeResistance) {
  for (const auto* layers : {&kRoad, &kThickConcrete, &kSheet}) {
    const FosterNetwork n = network(*layers, kMaxFosterModes);
    const auto surface = foster_surface(n, 0.93, 286.15, kReferenceK);
    const FosterDrive<double> drive{.absorbed_w_m2 = 800, .film_w_m2_k = 13.3, .air_offset_k = 3};
    FosterState<double> x = steady_start(n, surface);
    const auto gains = foster_gains(1e9, n);
    for (int i = 0; i < 40; ++i) foster_step(x, drive, drive, gains, surface);
    const double conductance = 1.0 / n.resistance_m2k_w();
    const auto expected = solve_equilibrium<double>(
        {surface.emission_w_m2_k4, 13.3 + conductance, 800 + 13.3 * 298 + conductance * 286.15});
    EXPECT_NEAR(kReferenceK + foster_offset_k(x, surface), expected.temperature_k, 1e-7);
    // The state stays there, whatever the step is.
    foster_step(x, drive, drive, foster_gains(1.0, n), surface);
    EXPECT_NEAR(kReferenceK + foster_offset_k(x, surface), expected.temperature_k, 1e-7);
  }
}

TEST(FosterStep, NoTimeChangesNothing) {
  const FosterNetwork n = network(kRoad, 4);
  const auto surface = foster_surface(n, 0.93, 286.15, kReferenceK);
  FosterState<double> x = steady_start(n, surface);
  const auto before = x;
  foster_step(x, morning(0, true), morning(0, true), foster_gains(0.0, n), surface);
  EXPECT_EQ(x, before);
}

TEST(FosterStep, StaysFiniteForAnyStepAndSheet) {
  for (const auto* layers : {&kRoad, &kThickConcrete, &kSheet}) {
    const FosterNetwork n = network(*layers, kMaxFosterModes);
    const auto surface = foster_surface(n, 0.93, 286.15, kReferenceK);
    for (const double dt_s : {1e-9, 1e-3, 1.0, 1e3, 1e6, 3.15e7}) {
      FosterState<double> x = steady_start(n, surface);
      const auto gains = foster_gains(dt_s, n);
      for (int i = 0; i < 100; ++i) {
        // Noon and night take turns: a step that overshoots would show.
        foster_step(x, morning(12600, i % 2 == 0), morning(0, i % 3 == 0), gains, surface);
        const double t = kReferenceK + foster_offset_k(x, surface);
        ASSERT_GT(t, 230.0);
        ASSERT_LT(t, 380.0);
      }
    }
  }
}

TEST(FosterStep, SecondOrderUnderSplitting) {
  for (const auto* layers : {&kRoad, &kThickConcrete, &kSheet}) {
    const FosterNetwork n = network(*layers, kMaxFosterModes);
    const double exact = run_split(n, 16384);
    const double coarse = std::abs(run_split(n, 256) - exact);
    const double fine = std::abs(run_split(n, 1024) - exact);
    const double order = std::log2(coarse / fine) / 2.0;
    RecordProperty("order", std::to_string(order));
    EXPECT_GT(order, 1.8) << coarse << " " << fine;
  }
}

TEST(FosterStep, ControlledStepsKeepTheirToleranceAgainstAThousandfoldSplit) {
  for (const auto* layers : {&kRoad, &kThickConcrete, &kSheet}) {
    for (std::size_t modes = 2; modes <= kMaxFosterModes; ++modes) {
      const FosterNetwork n = network(*layers, modes);
      const double exact = run_split(n, 1000);
      for (const double tolerance_k : {0.3, 0.1, 0.03, 0.01}) {
        double estimate_k = 0.0;
        int steps = 0;
        const double got = run_controlled(n, tolerance_k, &estimate_k, &steps);
        RecordProperty("error", std::to_string(std::abs(got - exact)));
        EXPECT_LT(std::abs(got - exact), tolerance_k);
      }
    }
  }
}

TEST(FosterStep, FloatFollowsDoubleWithinAMillikelvin) {
  for (const auto* layers : {&kRoad, &kThickConcrete, &kSheet}) {
    const FosterNetwork n = network(*layers, kMaxFosterModes);
    const auto surface = foster_surface(n, 0.93, 286.15, kReferenceK);
    FosterSurface<float> surface_f;
    surface_f.emission_w_m2_k4 = static_cast<float>(surface.emission_w_m2_k4);
    surface_f.base_offset_k = static_cast<float>(surface.base_offset_k);
    surface_f.reference_k = static_cast<float>(surface.reference_k);
    const auto narrow = [](const FosterState<double>& in) {
      FosterState<float> out;
      std::transform(in.begin(), in.end(), out.begin(),
                     [](double v) { return static_cast<float>(v); });
      return out;
    };
    surface_f.resistance_m2k_w = narrow(surface.resistance_m2k_w);
    const auto narrow_drive = [](const FosterDrive<double>& d) {
      return FosterDrive<float>{static_cast<float>(d.absorbed_w_m2),
                                static_cast<float>(d.film_w_m2_k),
                                static_cast<float>(d.air_offset_k)};
    };
    for (const int splits : {1, 10, 1000}) {
      FosterState<double> x = steady_start(n, surface);
      FosterState<float> y = narrow(x);
      double worst_k = 0.0;
      for (const Interval& interval : intervals()) {
        const auto gains = foster_gains((interval.end_s - interval.begin_s) / splits, n);
        const FosterGains<float> gains_f{narrow(gains.start_frac), narrow(gains.end_frac)};
        const auto begin = morning(interval.begin_s, interval.lit);
        const auto end = morning(interval.end_s, interval.lit);
        for (int i = 0; i < splits; ++i) {
          const auto from = lerp(begin, end, static_cast<double>(i) / splits);
          const auto to = lerp(begin, end, (i + 1.0) / splits);
          foster_step(x, from, to, gains, surface);
          foster_step(y, narrow_drive(from), narrow_drive(to), gains_f, surface_f);
        }
        worst_k = std::max(worst_k, std::abs(foster_offset_k(x, surface) -
                                             static_cast<double>(foster_offset_k(y, surface_f))));
      }
      EXPECT_LT(worst_k, 1e-3) << splits;
    }
  }
}

TEST(Relaxation, SplittingALinearStepAThousandTimesMovesNothing) {
  // Test the rule of emit2014 in float32 as on the device: offsets, and gains from double.
  for (const double tau_s : {8.0, 609.0, 7259.0}) {
    for (const double dt_s : {20.0, 466.0, 3600.0}) {
      const auto whole = relaxation_gains(dt_s, tau_s);
      const RelaxationGains<float> whole_f{static_cast<float>(whole.start_frac),
                                           static_cast<float>(whole.end_frac)};
      const float expected = relax_linear(-5.0F, 12.0F, 27.0F, whole_f);
      for (const int splits : {2, 10, 100, 1000}) {
        const auto part = relaxation_gains(dt_s / splits, tau_s);
        const RelaxationGains<float> part_f{static_cast<float>(part.start_frac),
                                            static_cast<float>(part.end_frac)};
        float x = -5.0F;
        for (int i = 0; i < splits; ++i) {
          const auto at = [&](int k) {
            return 12.0F + 15.0F * static_cast<float>(k) / static_cast<float>(splits);
          };
          x = relax_linear(x, at(i), at(i + 1), part_f);
        }
        EXPECT_NEAR(x, expected, 1e-3) << tau_s << " " << dt_s << " " << splits;
      }
    }
  }
}

TEST(FosterAdvance, tells_the_bow_of_the_temperature) {
  // Expect the temperature of two halves of the interval in the middle of the whole one, minus the
  // mean of its ends, for ground on which the sun begins to shine.
  FosterNetwork network;
  network = {{{{4.0, 0.004}, {60.0, 0.01}, {1800.0, 0.05}, {2e5, 0.6}}}, 4};
  const FosterSurface<double> surface = foster_surface(network, 0.95, 288.0, 288.15);
  const FosterDrive<double> begin{1100.0, 15.0, 5.0};
  for (const double dt_s : {0.5, 5.0, 20.0, 300.0}) {
    for (const double later_w_m2 : {1100.0, 300.0}) {
      const FosterDrive<double> end{later_w_m2, 12.0, 6.0};
      constexpr double kToleranceK = 1e-4;
      FosterState<double> whole{};
      const FosterAdvance told =
          foster_advance(whole, begin, end, foster_ladder(dt_s, network), surface, kToleranceK);
      FosterState<double> half{};
      const FosterDrive<double> middle = lerp(begin, end, 0.5);
      const FosterLadder halves = foster_ladder(0.5 * dt_s, network);
      foster_advance(half, begin, middle, halves, surface, kToleranceK);
      const double middle_k = foster_offset_k(half, surface);
      foster_advance(half, middle, end, halves, surface, kToleranceK);
      const double end_k = foster_offset_k(half, surface);
      const double expected_k =
          middle_k - 0.5 * (foster_offset_k(FosterState<double>{}, surface) + end_k);
      EXPECT_NEAR(told.bow_k, expected_k, 1e-3) << dt_s << " s";
      EXPECT_GT(told.bow_k, 0.0) << dt_s << " s";
    }
  }
}

/// Surfaces that differ in everything, so that they need different splits of the interval.
TEST(FosterLanes, have_the_bits_of_single_surfaces) {
  std::mt19937_64 random(11);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  FosterNetwork networks[3];
  networks[0] = {{{{60.0, 0.01}, {1800.0, 0.05}, {2e4, 0.2}, {2e5, 0.6}}}, 4};
  networks[1] = {{{{20.0, 0.002}, {900.0, 0.4}}}, 2};
  networks[2] = {
      {{{20.0, 0.005}, {200.0, 0.01}, {1500.0, 0.02}, {9e3, 0.05}, {5e4, 0.2}, {1e6, 1.5}}}, 6};
  for (const double dt_s : {0.0, 5.0, 600.0, 7200.0}) {
    const FosterLadder ladders[] = {foster_ladder(dt_s, networks[0]),
                                    foster_ladder(dt_s, networks[1]),
                                    foster_ladder(dt_s, networks[2])};
    // Numbers of surfaces around the number of lanes: none, one, some lanes free, several groups.
    // The networks of the odd numbers all have few modes.
    for (const std::size_t count : {0U, 1U, 2U, 7U, 8U, 9U, 16U, 17U}) {
      std::vector<FosterState<double>> single(count);
      std::vector<FosterState<double>> together;
      std::vector<FosterLane> lanes(count);
      std::vector<double> bows_k(count, -1.0);
      std::vector<double> single_bows_k(count);
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t kind = i % (count % 2 == 0 ? 3 : 2);
        for (std::size_t m = 0; m < networks[kind].count; ++m) single[i][m] = number(-20.0, 30.0);
        FosterLane& lane = lanes[i];
        lane.begin = {number(0.0, 1200.0), number(0.0, 40.0), number(-40.0, 20.0)};
        // Some balances have no positive root, so that they are clamped.
        lane.end = {i % 5 == 3 ? -1e6 : number(0.0, 1200.0), number(0.0, 40.0),
                    number(-40.0, 20.0)};
        lane.ladder = &ladders[kind];
        lane.surface = foster_surface(networks[kind], i % 7 == 6 ? 0.0 : number(0.02, 1.0),
                                      number(270.0, 300.0), 288.15);
      }
      together = single;
      for (std::size_t i = 0; i < count; ++i) {
        lanes[i].x = &together[i];
        // Some lanes ask for no bow.
        if (i % 3 != 1) lanes[i].bow_k = &bows_k[i];
        single_bows_k[i] = foster_advance(single[i], lanes[i].begin, lanes[i].end, *lanes[i].ladder,
                                          lanes[i].surface, 0.02)
                               .bow_k;
      }
      foster_advance_all(lanes, 0.02);
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(std::bit_cast<std::uint64_t>(bows_k[i]),
                  std::bit_cast<std::uint64_t>(lanes[i].bow_k == nullptr ? -1.0 : single_bows_k[i]))
            << dt_s << " s, " << count << " surfaces, surface " << i;
        // States that a network does not have are not defined where the balance was clamped.
        for (std::size_t m = 0; m < lanes[i].ladder->modes; ++m) {
          EXPECT_EQ(std::bit_cast<std::uint64_t>(together[i][m]),
                    std::bit_cast<std::uint64_t>(single[i][m]))
              << dt_s << " s, " << count << " surfaces, surface " << i << ", mode " << m;
        }
      }
    }
  }
}

}  // namespace
}  // namespace emit::physics
