// SPDX-License-Identifier: Apache-2.0
#include "history/part_history.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/times.hpp"

namespace emit::renderer {
namespace {

using Kind = scene::PartCommand::Kind;
using test::kSecondNs;

scene::PartDesc engine() {
  scene::PartDesc part;
  part.name = "engine";
  part.curve = {.given = true,
                .idle_k = 350.0,
                .full_k = 450.0,
                .cold_k = 290.0,
                .up_s = 100.0,
                .down_s = 400.0};
  return part;
}

TEST(PartHistory, a_part_without_commands_does_nothing) {
  const PartHistory history(engine(), 0, 0);
  EXPECT_EQ(history.at(0).power_w_m2, 0.0);
  EXPECT_EQ(history.at(0).contact_w_m2_k, 0.0);
}

TEST(PartHistory, a_throttle_warms_by_one_time_constant_and_cools_by_the_other) {
  scene::PartDesc part = engine();
  part.commands = {{0, {Kind::throttle, 0.5}},
                   {200 * kSecondNs, {Kind::throttle, 0.0}},
                   {600 * kSecondNs, {Kind::off, 0.0}}};
  const PartHistory history(part, 0, 0);
  EXPECT_EQ(history.at(-1).contact_w_m2_k, 0.0);
  const auto at_k = [&](double s) { return history.at(std::llround(s * 1e9)).behind_k; };
  EXPECT_NEAR(at_k(0.0), 290.0, 1e-9);
  EXPECT_NEAR(at_k(100.0), 400.0 - 110.0 * std::exp(-1.0), 1e-9);
  // Idle is below the 385 K that it has reached, so that it cools by the slow constant.
  const double warm_k = 400.0 - 110.0 * std::exp(-2.0);
  EXPECT_NEAR(at_k(600.0), 350.0 + (warm_k - 350.0) * std::exp(-1.0), 1e-9);
  const double idle_k = at_k(600.0);
  EXPECT_NEAR(at_k(1400.0), 290.0 + (idle_k - 290.0) * std::exp(-2.0), 1e-9);
}

TEST(PartHistory, temperature_and_power_act_at_once_and_off_lets_go) {
  scene::PartDesc part;
  part.commands = {{0, {Kind::temperature, 500.0}},
                   {10 * kSecondNs, {Kind::power, 300.0}},
                   {20 * kSecondNs, {Kind::off, 0.0}}};
  const PartHistory history(part, 3, 4);
  EXPECT_EQ(history.entity(), 3U);
  EXPECT_EQ(history.material(), 4U);
  EXPECT_EQ(history.at(0).behind_k, 500.0);
  EXPECT_EQ(history.at(0).contact_w_m2_k, kHeldContactW_m2K);
  EXPECT_EQ(history.at(10 * kSecondNs).power_w_m2, 300.0);
  EXPECT_EQ(history.at(10 * kSecondNs).contact_w_m2_k, 0.0);
  EXPECT_EQ(history.at(20 * kSecondNs).power_w_m2, 0.0);
  EXPECT_EQ(history.at(20 * kSecondNs).contact_w_m2_k, 0.0);
}

}  // namespace
}  // namespace emit::renderer
