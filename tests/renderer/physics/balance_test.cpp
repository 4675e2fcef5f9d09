// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface_balance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace emit::physics {
namespace {

TEST(SurfaceBalance, IsothermalEnclosureGivesItsOwnTemperatureForEverySkyFactor) {
  const double t0 = 293.0;
  const double eps = 0.9;
  const double sky_longwave = kStefanBoltzmannWPerM2K4 * std::pow(t0, 4);
  for (const double sky : {0.0, 0.2, 0.5, 0.75, 1.0}) {
    SurfaceFluxes<double> in;
    in.environment_w_m2 = environment_input_w_m2(eps, t0);
    in.longwave_w_m2 = longwave_input_w_m2(sky_longwave, t0);
    in.sky_frac = sky;
    EXPECT_NEAR(radiative_temperature_k(absorbed_flux_w_m2(in, 0.7, eps), eps), t0, 1e-11) << sky;
  }
}

TEST(SurfaceBalance, OpenFlatGroundAbsorbsTheSkyAndNothingOfTheSurroundings) {
  SurfaceFluxes<double> in;
  in.sky_frac = 0.5;
  in.environment_w_m2 = environment_input_w_m2(0.93, 295.0);
  in.longwave_w_m2 = longwave_input_w_m2(345.0, 295.0);
  in.diffuse_w_m2 = diffuse_input_w_m2(110.0);
  EXPECT_NEAR(absorbed_flux_w_m2(in, 0.25, 0.93), 0.93 * 345.0 + 0.25 * 110.0, 1e-11);
}

TEST(SurfaceBalance, SunCountsOnlyWhereItIsSeenUncloudedAndInFront) {
  EXPECT_EQ(direct_on_face_w_m2(800.0, -0.2), 0.0);
  EXPECT_DOUBLE_EQ(direct_on_face_w_m2(800.0, 0.5), 400.0);
  SurfaceFluxes<double> in;
  in.direct_w_m2 = 400.0;
  in.sun_frac = 0.5;
  in.cloud_frac = 0.25;
  EXPECT_DOUBLE_EQ(absorbed_flux_w_m2(in, 0.8, 0.9), 0.8 * 400.0 * 0.5 * 0.75);
}

template <class Real>
SurfaceBalance<Real> random_balance(std::mt19937_64& random) {
  // The inputs are float32 values, so that float and double solve the same problem.
  const auto uniform = [&random](double lo, double hi) {
    return static_cast<double>(static_cast<float>(std::uniform_real_distribution(lo, hi)(random)));
  };
  const auto logarithmic = [&](double lo, double hi) {
    return static_cast<double>(static_cast<float>(std::exp(uniform(std::log(lo), std::log(hi)))));
  };
  SurfaceExchange<Real> x;
  x.emissivity_frac = static_cast<Real>(logarithmic(0.02, 1.0));
  x.core_conductance_w_m2_k =
      static_cast<Real>(static_cast<float>(logarithmic(0.02, 400.0) / logarithmic(1e-4, 1.0)));
  x.core_k = static_cast<Real>(uniform(200.0, 400.0));
  return surface_balance(
      environment_input_w_m2(x.emissivity_frac, static_cast<Real>(uniform(0.0, 1000.0))), x);
}

TEST(Equilibrium, RootSatisfiesTheBalanceInDouble) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 50000; ++i) {
    const auto b = random_balance<double>(random);
    const double t = solve_equilibrium(b).temperature_k;
    // One Newton step in long double measures the error of T itself.
    const long double tl = t;
    const long double e = b.emission_w_m2_k4;
    const long double g = b.conductance_w_m2_k;
    const long double step =
        ((e * tl * tl * tl + g) * tl - static_cast<long double>(b.source_w_m2)) /
        (4 * e * tl * tl * tl + g);
    ASSERT_LE(std::abs(static_cast<double>(step / tl)), 1e-14) << i;
  }
}

TEST(Equilibrium, FloatStaysWithinAMillikelvinOverTheWholeBox) {
  std::mt19937_64 seeds(2);
  double worst_k = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const auto seed = seeds();
    std::mt19937_64 a(seed);
    std::mt19937_64 b(seed);
    const float single = solve_equilibrium(random_balance<float>(a)).temperature_k;
    const double exact = solve_equilibrium(random_balance<double>(b)).temperature_k;
    ASSERT_TRUE(std::isfinite(single));
    worst_k = std::max(worst_k, std::abs(static_cast<double>(single) - exact));
  }
  EXPECT_LE(worst_k, 1e-3);
}

TEST(Equilibrium, LimitsAreTheCoreTheRadiativeTemperatureAndTheAir) {
  const double e = 0.9 * kStefanBoltzmannWPerM2K4;
  EXPECT_NEAR(solve_equilibrium<double>({e, 0.0, e * 1e10}).temperature_k,
              std::sqrt(std::sqrt(1e10)), 1e-10);
  EXPECT_NEAR(solve_equilibrium<double>({e, 1e12, 1e12 * 300.0}).temperature_k, 300.0, 1e-7);
  EXPECT_NEAR(solve_equilibrium<double>({0.0, 10.0, 3000.0}).temperature_k, 300.0, 1e-10);
}

TEST(Equilibrium, InputsBelowTheGuardsAreClampedAndReported) {
  for (const double source : {0.0, -500.0}) {
    const auto f = solve_equilibrium<float>({5e-8F, 10.0F, static_cast<float>(source)});
    EXPECT_TRUE(f.clamped);
    EXPECT_TRUE(std::isfinite(f.temperature_k));
    EXPECT_GE(f.temperature_k, 0.0F);
    EXPECT_LE(f.temperature_k, 1e-6F);
  }
  EXPECT_TRUE(solve_equilibrium<float>({0.0F, 10.0F, 3000.0F}).clamped);
  EXPECT_FALSE(solve_equilibrium<float>({5e-8F, 0.0F, 400.0F}).clamped);
  // No material can make the solver overflow: test metal foil, no emission and hardly any source.
  const auto extreme = solve_equilibrium<float>({0.0F, 4e6F, 0.0F});
  EXPECT_TRUE(std::isfinite(extreme.temperature_k));
}

TEST(Equilibrium, NanIsNotHidden) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(solve_equilibrium<double>({5e-8, 5.0, nan}).temperature_k));
  EXPECT_TRUE(std::isnan(solve_equilibrium<double>({5e-8, nan, 500.0}).temperature_k));
}

TEST(Equilibrium, ConvectionPullsTowardsTheAir) {
  SurfaceExchange<double> x{0.93, 0.7 / 0.15, 293.15, 0.0, 280.0};
  const double without = solve_equilibrium(surface_balance(700.0, x)).temperature_k;
  double previous = without;
  for (const double film : {5.0, 20.0, 100.0, 1e6}) {
    x.film_w_m2_k = film;
    const double t = solve_equilibrium(surface_balance(700.0, x)).temperature_k;
    EXPECT_LT(t, previous);
    EXPECT_GT(t, 280.0);
    previous = t;
  }
  EXPECT_NEAR(previous, 280.0, 1e-2);
}

}  // namespace
}  // namespace emit::physics
