// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/relaxation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace emit::physics {
namespace {

TEST(Relaxation, GainsMatchLongDoubleFromTinyToHugeSteps) {
  for (double z = 1e-14; z < 1e4; z *= 1.7) {
    const RelaxationGains<double> g = relaxation_gains(z, 1.0);
    const long double zl = z;
    const long double total = -std::expm1(-zl);
    // The series needs no more than these terms below 1e-2. Above, long double has enough bits.
    const long double end =
        z < 1e-2 ? zl / 2 * (1 - zl / 3 * (1 - zl / 4 * (1 - zl / 5 * (1 - zl / 6 * (1 - zl / 7)))))
                 : 1.0L - total / zl;
    EXPECT_NEAR(g.end_frac / static_cast<double>(end), 1.0, 1e-14) << z;
    EXPECT_NEAR((g.start_frac + g.end_frac) / static_cast<double>(total), 1.0, 1e-15) << z;
    EXPECT_GE(g.start_frac, 0.0);
  }
}

TEST(Relaxation, NoTimeChangesNothingAndInfiniteTimeArrives) {
  const auto none = relaxation_gains(0.0, 100.0);
  EXPECT_EQ(relax_linear(5.0, 10.0, 20.0, none), 5.0);
  const auto forever = relaxation_gains(std::numeric_limits<double>::infinity(), 100.0);
  EXPECT_EQ(relax_linear(5.0, 10.0, 20.0, forever), 20.0);
}

TEST(Relaxation, ConstantDriveIsTheExponential) {
  const auto g = relaxation_gains(70.0, 50.0);
  EXPECT_NEAR(relax_constant(2.0, 12.0, g), 12.0 - 10.0 * std::exp(-1.4), 1e-14);
}

TEST(Relaxation, LinearDriveFollowsTheClosedFormRamp) {
  // The solution for x(0) = 0 and u = r t is x = r (t - tau + tau e^{-t/tau}).
  const double rate = 0.02;
  const double tau = 300.0;
  for (const double t : {1.0, 100.0, 1000.0, 1e5}) {
    const double exact = rate * (t - tau + tau * std::exp(-t / tau));
    EXPECT_NEAR(relax_linear(0.0, 0.0, rate * t, relaxation_gains(t, tau)), exact,
                1e-12 * std::max(1.0, rate * t));
  }
}

TEST(Relaxation, SplittingAStepChangesNothing) {
  const double tau = 1234.0;
  double split = 3.0;
  const int parts = 1000;
  const double dt = 5000.0;
  for (int i = 0; i < parts; ++i) {
    split = relax_linear(split, 10.0 + 20.0 * i / parts, 10.0 + 20.0 * (i + 1) / parts,
                         relaxation_gains(dt / parts, tau));
  }
  EXPECT_NEAR(split, relax_linear(3.0, 10.0, 30.0, relaxation_gains(dt, tau)), 1e-11);
}

TEST(Relaxation, FloatOffsetsDoNotStallAtSixtyHertz) {
  // Step for half an hour at 60 Hz with a slow mode: a state in kelvin would be a kelvin off in
  // float32.
  const auto g = relaxation_gains(1.0 / 60.0, 7259.0);
  const RelaxationGains<float> gains{static_cast<float>(g.start_frac),
                                     static_cast<float>(g.end_frac)};
  float offset = 0.0F;
  for (int i = 0; i < 108000; ++i) offset = relax_constant(offset, 20.0F, gains);
  EXPECT_NEAR(static_cast<double>(offset), -20.0 * std::expm1(-1800.0 / 7259.0), 1e-3);
}

}  // namespace
}  // namespace emit::physics
