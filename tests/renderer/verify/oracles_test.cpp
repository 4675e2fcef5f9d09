// SPDX-License-Identifier: Apache-2.0
// Tests of the CPU models against tables computed with 60 digits, through the evaluator as a user
// runs it.
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "emit/physics/constants.hpp"
#include "support/oracle_check.hpp"

namespace emit {
namespace {

using test::run_oracle;
using verify::Device;
using verify::Precision;

/// Error limits. Double must reach the rounding of the inputs; float32 must reach the limits of the
/// shader path, whose source it shares.
struct Limits {
  Precision precision;
  double equilibrium_frac;  // relative error of T
  double equilibrium_k;
  double balance_k;
  double radiance_frac;  // relative error within 200..3000 K
  double relaxation_k;
};
class PhysicsOracles : public testing::TestWithParam<Limits> {};

INSTANTIATE_TEST_SUITE_P(Cpu, PhysicsOracles,
                         testing::Values(Limits{Precision::float64, 1e-14, 1e-9, 1e-9, 1e-13, 1e-9},
                                         Limits{Precision::float32, 3e-7, 1e-3, 1e-3, 1e-4, 2e-3}),
                         [](const auto& limits) {
                           return limits.param.precision == Precision::float64 ? "double" : "float";
                         });

TEST_P(PhysicsOracles, EquilibriumTemperatureOfEveryRow) {
  const auto run =
      run_oracle("equilibrium", "quartic_roots.csv", GetParam().precision, Device::cpu);
  const auto t = run.column("Ts");
  for (std::size_t i = 0; i < t.got.size(); ++i) {
    EXPECT_NEAR(t.got[i], t.expected[i], GetParam().equilibrium_k) << "row " << i;
    EXPECT_NEAR(t.got[i] / t.expected[i], 1.0, GetParam().equilibrium_frac) << "row " << i;
  }
}

TEST_P(PhysicsOracles, BalanceOfTheWorkedExample) {
  const auto run = run_oracle("balance", "golden_example.csv", GetParam().precision, Device::cpu);
  for (const char* name : {"E_abs", "Ta", "Ts", "Ts_conv"}) {
    const auto c = run.column(name);
    for (std::size_t i = 0; i < c.got.size(); ++i) {
      EXPECT_NEAR(c.got[i], c.expected[i], GetParam().balance_k) << name << " row " << i;
    }
  }
}

TEST_P(PhysicsOracles, BandRadianceOfEveryRow) {
  const auto run =
      run_oracle("band-radiance", "planck_inband.csv", GetParam().precision, Device::cpu);
  const auto temperature = *run.expected.numbers("T_K");
  for (const char* name : {"L_3_5", "L_3.4_4.1", "L_8_12", "L_7.7_9.3"}) {
    const auto c = run.column(name);
    for (std::size_t i = 0; i < c.got.size(); ++i) {
      const bool in_range = temperature[i] >= 200.0 && temperature[i] <= 3000.0;
      if (in_range) {
        EXPECT_NEAR(c.got[i] / c.expected[i], 1.0, GetParam().radiance_frac) << name << " " << i;
      } else if (GetParam().precision == Precision::float64 && c.expected[i] > 1e-300) {
        // The rounding of x itself shows in e^-x for x in the hundreds.
        EXPECT_NEAR(c.got[i] / c.expected[i], 1.0, 5e-13) << name << " " << i;
      } else {
        EXPECT_NEAR(c.got[i], c.expected[i], 1e-3 * c.expected[i] + 1e-30) << name << " " << i;
      }
    }
  }
}

TEST_P(PhysicsOracles, RelaxationAtEveryQuery) {
  const auto run = run_oracle("relaxation", "relax_queries.csv", GetParam().precision, Device::cpu);
  const auto t = run.column("T_K");
  for (std::size_t i = 0; i < t.got.size(); ++i) {
    EXPECT_NEAR(t.got[i], t.expected[i], GetParam().relaxation_k) << "row " << i;
  }
}

TEST(SunOracle, PositionOfEveryRow) {
  const auto run =
      run_oracle("sun-position", "solar_position.csv", Precision::float64, Device::cpu);
  const auto elevation = run.column("elevation");
  const auto azimuth = run.column("azimuth");
  for (std::size_t i = 0; i < elevation.got.size(); ++i) {
    // The limit is a tenth of the 0.01 deg that shadows need. The truncated series reaches 0.0004.
    EXPECT_NEAR(elevation.got[i], elevation.expected[i], 1e-3) << "row " << i;
    const double turn = std::remainder(azimuth.got[i] - azimuth.expected[i], 360.0);
    EXPECT_NEAR(turn * std::cos(elevation.expected[i] * physics::kDegree), 0.0, 1e-3)
        << "row " << i;
  }
}

}  // namespace
}  // namespace emit
