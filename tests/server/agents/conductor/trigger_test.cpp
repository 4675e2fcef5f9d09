// SPDX-License-Identifier: Apache-2.0
// Pacing mode trigger: the triggers that begin a frame, and the reports of those that do not.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "pacing/trigger_gate.hpp"
#include "support/conductor_rig.hpp"

namespace emit::server {
namespace {

using test::kMs;
using Rig = test::ConductorRig;
using TriggerVerdict = TriggerGate::Verdict;

/// The sync source sends triggers at 100 Hz.
config::PacingConfig triggered() {
  config::PacingConfig pacing;
  pacing.mode = config::PacingMode::trigger;
  pacing.rate_hz = 100.0;
  return pacing;
}

TEST(TriggerGate, JudgesNumbersAndDistances) {
  TriggerGate gate(100.0, 0);
  const auto check = [&](std::uint64_t run, std::uint64_t number, std::int64_t at_ms,
                         std::int64_t edge_ns = 0) {
    return gate.check({run, number, edge_ns}, at_ms * kMs);
  };
  EXPECT_EQ(check(5, 7, 1000).verdict, TriggerVerdict::use);
  EXPECT_EQ(check(5, 7, 1010).verdict, TriggerVerdict::duplicate);
  EXPECT_EQ(check(5, 6, 1010).verdict, TriggerVerdict::duplicate) << "out of order";
  const auto next = check(5, 8, 1010);
  EXPECT_EQ(next.verdict, TriggerVerdict::use);
  EXPECT_EQ(next.missing, 0U);
  EXPECT_FALSE(next.late);
  EXPECT_EQ(check(5, 9, 1015).verdict, TriggerVerdict::too_fast);
  const auto gap = check(5, 12, 1050);
  EXPECT_EQ(gap.verdict, TriggerVerdict::use);
  EXPECT_EQ(gap.missing, 2U) << "the one that came too fast is not missing";
  EXPECT_FALSE(gap.late);
  EXPECT_TRUE(check(5, 13, 1066).late);
  EXPECT_FALSE(check(5, 14, 1076, 1075 * kMs).late);
  EXPECT_TRUE(check(5, 15, 1086, 1080 * kMs).late) << "6 ms on the way at a period of 10";
  EXPECT_EQ(check(4, 99, 1096).verdict, TriggerVerdict::duplicate) << "of a run that was replaced";
  EXPECT_EQ(check(6, 1, 1096).verdict, TriggerVerdict::use);
  EXPECT_EQ(check(6, 2, 1000).verdict, TriggerVerdict::use) << "the clock was set back";
}

TEST(TriggerPacing, BeginsAFrameWithEachTriggerOnTheNewestPose) {
  Rig rig(triggered());
  rig.settle();
  rig.pass(50 * kMs);
  EXPECT_EQ(rig.frames.size(), 0U) << "no trigger, no frame";
  rig.with([](protocol::HostFrameData& frame) {
       frame.seeker_rates = protocol::PoseRates{{100.0, 0.0, 0.0}, {}};
     })
      .send(1, 500 * kMs, 1.0);
  rig.settle();
  EXPECT_EQ(rig.frames.size(), 0U) << "a pose starts nothing";
  rig.clock.set(rig.clock.tai_ns() + 20 * kMs);
  const std::int64_t edge_ns = rig.clock.tai_ns();
  rig.trigger(9);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 1U);
  const auto& header = rig.frames[0].header;
  EXPECT_EQ(header.trigger_number, 9U);
  EXPECT_EQ(header.slot_begin_ns, edge_ns);
  EXPECT_EQ(header.deadline_ns, edge_ns + 10 * kMs);
  EXPECT_EQ(header.sim_time_ns, 520 * kMs) << "extrapolated to the trigger's instant";
  EXPECT_NEAR(header.pose.position_world_m.x, 3.0, 1e-9);
  EXPECT_EQ(header.flags, protocol::kFlagExtrapolated);
  EXPECT_EQ(rig.count(Counter::triggers_used), 1U);
}

TEST(TriggerPacing, TakesAPoseThatCameBeforeTheTriggerInTheSameTurn) {
  Rig rig(triggered());
  rig.settle();
  rig.send(1, 500 * kMs, 7.0);
  rig.trigger(1);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 1U);
  EXPECT_EQ(rig.frames[0].header.host_frame_number, 1U);
  EXPECT_EQ(rig.frames[0].header.pose.position_world_m.x, 7.0);
}

TEST(TriggerPacing, RepeatsAtTheDeadlineThenShowsTheLateFrame) {
  Rig rig(triggered());
  rig.settle();
  rig.trigger(1);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 1U);
  rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
  rig.script.ready = false;
  rig.trigger(2);
  rig.settle();
  EXPECT_EQ(rig.frames.size(), 1U);
  rig.pass(10 * kMs);
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_TRUE(rig.frames[1].repeat);
  EXPECT_NE(rig.frames[1].header.flags & protocol::kFlagRepeated, 0U);
  EXPECT_EQ(rig.frames[1].header.trigger_number, 2U);
  rig.pass(2 * kMs);
  rig.script.ready = true;
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 3U);
  EXPECT_FALSE(rig.frames[2].repeat);
  EXPECT_NE(rig.frames[2].header.flags & protocol::kFlagLate, 0U)
      << "late although no other slot has begun";
  EXPECT_EQ(rig.frames[2].header.trigger_number, 2U);
  for (std::size_t i = 0; i < rig.frames.size(); ++i) {
    EXPECT_EQ(rig.frames[i].header.frame_number, i + 1);
  }
}

TEST(TriggerPacing, ATriggerEndsTheSlotBeforeIt) {
  auto pacing = triggered();
  Rig rig(pacing);
  rig.settle();
  rig.trigger(1);
  rig.settle();
  rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
  rig.script.ready = false;
  rig.trigger(2);
  rig.settle();
  rig.clock.set(rig.clock.tai_ns() + 8 * kMs);  // early, but not too fast
  rig.trigger(3);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_TRUE(rig.frames[1].repeat);
  EXPECT_EQ(rig.frames[1].header.trigger_number, 2U);
  rig.script.ready = true;
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 3U);
  EXPECT_NE(rig.frames[2].header.flags & protocol::kFlagLate, 0U);
  rig.pass(20 * kMs);
  EXPECT_EQ(rig.frames.size(), 3U) << "the late frame fills the slot of trigger 3";
}

TEST(TriggerPacing, CountsAndFlagsFaultsOnTheNextFrame) {
  Rig rig(triggered());
  rig.settle();
  const auto trigger = [&](std::uint64_t number, std::int64_t after_ms) {
    rig.clock.set(rig.clock.tai_ns() + after_ms * kMs);
    rig.trigger(number);
    rig.settle();
  };
  const auto faulty = [&] {
    return (rig.frames.back().header.flags & protocol::kFlagTriggerFault) != 0;
  };
  trigger(1, 10);
  EXPECT_FALSE(faulty());
  trigger(4, 30);
  EXPECT_TRUE(faulty());
  EXPECT_EQ(rig.count(Counter::triggers_missing), 2U);
  trigger(5, 10);
  EXPECT_FALSE(faulty());
  trigger(5, 1);
  trigger(6, 2);
  EXPECT_EQ(rig.frames.size(), 3U) << "neither of them starts a frame";
  EXPECT_EQ(rig.count(Counter::triggers_duplicate), 1U);
  EXPECT_EQ(rig.count(Counter::triggers_too_fast), 1U);
  trigger(7, 10);
  EXPECT_TRUE(faulty());
  trigger(8, 16);
  EXPECT_TRUE(faulty());
  EXPECT_EQ(rig.count(Counter::triggers_late), 1U);
  trigger(9, 10);
  EXPECT_FALSE(faulty());
  EXPECT_EQ(rig.count(Counter::triggers_used), 6U);
}

TEST(TriggerPacing, SaysOnceThatTheSourceIsSilent) {
  Rig rig(triggered());
  rig.settle();
  rig.pass(1000 * kMs);
  EXPECT_EQ(rig.count(Counter::trigger_silences), 0U) << "it has not begun";
  rig.trigger(1);
  rig.settle();
  rig.pass(10 * kMs);
  EXPECT_EQ(rig.conductor().wake_at_ns(), rig.clock.tai_ns() + 90 * kMs);
  rig.pass(89 * kMs);
  EXPECT_EQ(rig.count(Counter::trigger_silences), 0U);
  rig.pass(1 * kMs);
  rig.pass(500 * kMs);
  EXPECT_EQ(rig.count(Counter::trigger_silences), 1U);
  EXPECT_EQ(rig.conductor().wake_at_ns(), kNeverNs);
  rig.trigger(2);
  rig.settle();
  EXPECT_NE(rig.frames.back().header.flags & protocol::kFlagTriggerFault, 0U);
}

TEST(TriggerPacing, LeavesOutTriggersOfLongAgo) {
  Rig rig(triggered());
  rig.settle();
  for (std::uint64_t number = 1; number <= 8; ++number) {
    rig.trigger(number);
    rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
  }
  rig.settle();  // the conductor did not run meanwhile
  EXPECT_EQ(rig.count(Counter::slots_missed), 4U);
  EXPECT_EQ(rig.count(Counter::triggers_used), 4U);
  ASSERT_FALSE(rig.frames.empty());
  EXPECT_EQ(rig.frames.front().header.trigger_number, 5U);
  EXPECT_NE(rig.frames.front().header.flags & protocol::kFlagTriggerFault, 0U);
}

TEST(TriggerPacing, StopsAndStepsLikeTheOtherModes) {
  Rig rig(triggered());
  rig.settle();
  const auto trigger = [&](std::uint64_t number) {
    rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
    rig.trigger(number);
    rig.settle();
  };
  trigger(1);
  rig.command(CommandKind::stop);
  rig.settle();
  trigger(2);
  EXPECT_EQ(rig.frames.size(), 1U);
  rig.command(CommandKind::step);
  rig.settle();
  trigger(3);
  trigger(4);
  EXPECT_EQ(rig.frames.size(), 2U);
  rig.command(CommandKind::reset);
  rig.settle();
  rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
  rig.trigger(1, 0x0);  // RESET lets any run of the source in
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 3U);
  EXPECT_EQ(rig.frames.back().header.frame_number, 1U);
}

TEST(PredictionError, IsMeasuredWhenTheTruthComes) {
  Rig rig(triggered());
  rig.settle();
  const auto moving = [](double rad) {
    return [rad](protocol::HostFrameData& frame) {
      frame.seeker_rates = protocol::PoseRates{{100.0, 0.0, 0.0}, {}};
      frame.seeker.world_from_body = glm::dquat{std::cos(rad / 2.0), 0.0, 0.0, std::sin(rad / 2.0)};
    };
  };
  rig.with(moving(0.0)).send(1, 0, 0.0);
  rig.settle();
  rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
  rig.trigger(1);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 1U);
  EXPECT_EQ(rig.frames[0].header.predictions, 0U);
  EXPECT_EQ(rig.context().prediction.position.count(0), 0U);
  // The prediction is 1 m on at 10 ms. The truth at 20 ms is 3 m and 0.2 rad, so half of that at 10
  // ms.
  rig.clock.set(rig.clock.tai_ns() + 10 * kMs);
  rig.with(moving(0.2)).send(2, 20 * kMs, 3.0);
  rig.trigger(2);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_EQ(rig.frames[1].header.predictions, 1U);
  EXPECT_NEAR(rig.frames[1].header.prediction_error_m, 0.5, 1e-6);
  EXPECT_NEAR(rig.frames[1].header.prediction_error_rad, 0.1, 1e-6);
  EXPECT_NEAR(rig.context().prediction.max_position_m.load(), 0.5, 1e-9);
  EXPECT_NEAR(rig.context().prediction.max_attitude_rad.load(), 0.1, 1e-9);
  EXPECT_EQ(rig.context().prediction.position.sum_ns(), 500'000'000U);
}

TEST(PredictionError, KeepsTheNewestPredictionsAndForgetsThoseOfAnotherRun) {
  PredictionCheck check;
  PoseTrack truth;
  const auto at = [](std::int64_t sim_ns, double x_m) {
    TimedPose pose;
    pose.sim_time_ns = sim_ns;
    pose.pose.position_world_m.x = x_m;
    return pose;
  };
  truth.push(at(0, 0.0));
  for (std::size_t i = 1; i <= PredictionCheck::kKept + 10; ++i) {
    check.predicted(static_cast<std::int64_t>(i), physics::Pose{});
    check.predicted(static_cast<std::int64_t>(i), physics::Pose{});
  }
  truth.push(at(1000, 1000.0));
  std::vector<double> errors_m;
  const auto keep = [&](const PredictionError& error) { errors_m.push_back(error.position_m); };
  check.compare(truth, keep);
  ASSERT_EQ(errors_m.size(), PredictionCheck::kKept);
  EXPECT_NEAR(errors_m.front(), 11.0, 1e-9);
  EXPECT_EQ(check.measured(), PredictionCheck::kKept);
  check.predicted(2000, physics::Pose{});
  check.clear();
  truth.push(at(3000, 0.0));
  check.compare(truth, keep);
  EXPECT_EQ(errors_m.size(), PredictionCheck::kKept);
  EXPECT_EQ(check.measured(), 0U);
}

}  // namespace
}  // namespace emit::server
