// SPDX-License-Identifier: Apache-2.0
#include "motion/axis_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emit::server {
namespace {

constexpr double kModelStepS = 1e-3;

AxisDynamics free_axis() {
  AxisDynamics out;
  out.limits = {.rate_rad_s = 1e6, .acceleration_rad_s2 = 1e9};
  return out;
}

AxisModel model_of(const AxisDynamics& dynamics) {
  auto model = AxisModel::create(dynamics, kModelStepS, 1);
  EXPECT_TRUE(model.has_value());
  model->start(0.0);
  return *model;
}

TEST(AxisModel, answers_a_step_as_a_second_order_system) {
  AxisDynamics dynamics = free_axis();
  dynamics.natural_rad_s = 60.0;
  dynamics.damping = 0.4;
  AxisModel model = model_of(dynamics);
  // The first step of the caller leads to the new command; the closed form starts at its end.
  const double w = dynamics.natural_rad_s;
  const double d = dynamics.damping;
  const double wd = w * std::sqrt(1.0 - d * d);
  model.step({1.0, 0.0, 0.0});
  const double angle0 = model.motion().angle_rad - 1.0;
  const double rate0 = model.motion().rate_rad_s;
  for (int i = 1; i < 300; ++i) {
    const double t = i * kModelStepS;
    const double expected =
        1.0 + std::exp(-d * w * t) *
                  (angle0 * std::cos(wd * t) + (rate0 + d * w * angle0) / wd * std::sin(wd * t));
    EXPECT_NEAR(model.step({1.0, 0.0, 0.0}).angle_rad, expected, 1e-4) << t;
  }
}

TEST(AxisModel, follows_a_smooth_command_with_its_feed_forward) {
  AxisModel model = model_of(free_axis());
  for (int i = 1; i < 2000; ++i) {
    const double phase = 5.0 * kModelStepS * i;
    const double rise = 1.0 - std::exp(-phase * phase);
    const double rise1 = 10.0 * phase * std::exp(-phase * phase);
    const double rise2 = 25.0 * (2.0 - 4.0 * phase * phase) * std::exp(-phase * phase);
    // The acceleration begins with a jump, whose trace dies away with the servo's own motion. A
    // command in between is linear, which leaves up to an eighth of acceleration times step
    // squared.
    EXPECT_NEAR(model.step({rise, rise1, rise2}).angle_rad, rise, i < 100 ? 1e-4 : 5e-6) << i;
  }
}

TEST(AxisModel, keeps_to_rate_acceleration_and_travel) {
  AxisDynamics dynamics;
  dynamics.limits = {-0.5, 0.8, 2.0, 40.0};
  AxisModel model = model_of(dynamics);
  AxisMotion before;
  for (int i = 0; i < 3000; ++i) {
    const AxisMotion now = model.step({i < 1500 ? 3.0 : -3.0, 0.0, 0.0});
    EXPECT_LE(std::abs(now.rate_rad_s), 2.0);
    EXPECT_GE(now.angle_rad, -0.5);
    EXPECT_LE(now.angle_rad, 0.8);
    // Only the end of the travel stops it faster.
    if (now.angle_rad > -0.5 && now.angle_rad < 0.8) {
      EXPECT_LE(std::abs(now.rate_rad_s - before.rate_rad_s), 40.0 * kModelStepS * (1.0 + 1e-9));
    }
    before = now;
  }
  EXPECT_EQ(before.angle_rad, -0.5);
}

TEST(AxisModel, answers_after_its_delay) {
  AxisDynamics dynamics = free_axis();
  dynamics.delay_s = 0.007;
  AxisModel model = model_of(dynamics);
  for (int i = 0; i < 7; ++i) EXPECT_EQ(model.step({1.0, 0.0, 0.0}).angle_rad, 0.0);
  EXPECT_GT(model.step({1.0, 0.0, 0.0}).angle_rad, 0.0);
}

TEST(AxisModel, measures_with_noise_and_resolution) {
  AxisDynamics dynamics = free_axis();
  dynamics.noise_rad = 1e-3;
  AxisModel model = model_of(dynamics);
  double sum = 0.0;
  double squares = 0.0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    const double angle_rad = model.measure().angle_rad;
    sum += angle_rad;
    squares += angle_rad * angle_rad;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 5e-5);
  EXPECT_NEAR(std::sqrt(squares / kCount), 1e-3, 3e-5);
  dynamics.noise_rad = 0.0;
  dynamics.resolution_rad = 0.01;
  AxisModel coarse = model_of(dynamics);
  coarse.start(0.123);
  EXPECT_DOUBLE_EQ(coarse.measure().angle_rad, 0.12);
}

TEST(AxisModel, faults_stop_it_or_let_it_run_away) {
  AxisDynamics dynamics;
  dynamics.limits = {-1.0, 1.0, 2.0, 40.0};
  AxisModel model = model_of(dynamics);
  for (int i = 1; i <= 200; ++i) model.step({kModelStepS * i, 1.0, 0.0});
  model.set_fault(AxisFault::stuck);
  for (int i = 0; i < 1000; ++i) model.step({1.0, 1.0, 0.0});
  EXPECT_NEAR(model.motion().rate_rad_s, 0.0, 1e-6);
  EXPECT_LT(model.motion().angle_rad, 0.5);
  model.set_fault(AxisFault::runaway);
  for (int i = 0; i < 2000; ++i) model.step({0.0, 0.0, 0.0});
  EXPECT_EQ(model.motion().angle_rad, 1.0);
}

TEST(AxisModel, refuses_what_no_axis_is) {
  for (const auto& change : std::initializer_list<void (*)(AxisDynamics&)>{
           [](AxisDynamics& d) { d.natural_rad_s = 0.0; },
           [](AxisDynamics& d) { d.damping = -1.0; }, [](AxisDynamics& d) { d.delay_s = 1.0; },
           [](AxisDynamics& d) { d.delay_s = -1.0; }, [](AxisDynamics& d) { d.noise_rad = NAN; },
           [](AxisDynamics& d) { d.limits.rate_rad_s = 0.0; }}) {
    AxisDynamics dynamics = free_axis();
    change(dynamics);
    EXPECT_FALSE(AxisModel::create(dynamics, kModelStepS, 1).has_value());
  }
}

}  // namespace
}  // namespace emit::server
