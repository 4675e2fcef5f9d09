// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "pacing/deadline_policy.hpp"
#include "pacing/ig_clock.hpp"
#include "pacing/input_gate.hpp"
#include "pacing/pose_track.hpp"
#include "pacing/run_control.hpp"
#include "pacing/scenario_track.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kMs;

TimedPose at(std::int64_t time_ns, double x_m, double heading_rad = 0.0) {
  TimedPose out;
  out.sim_time_ns = time_ns;
  out.pose.position_world_m = {x_m, 0.0, 0.0};
  out.pose.world_from_body = {std::cos(heading_rad / 2), 0.0, 0.0, std::sin(heading_rad / 2)};
  return out;
}

TEST(PoseTrack, InterpolatesBetweenReceivedPoses) {
  PoseTrack track;
  track.push(at(0, 0.0, 0.0));
  track.push(at(10 * kMs, 1.0, 0.2));
  const PoseSample sample = track.sample(4 * kMs, 50 * kMs);
  EXPECT_NEAR(sample.pose.position_world_m.x, 0.4, 1e-12);
  EXPECT_NEAR(sample.pose.world_from_body.z, std::sin(0.04), 1e-12);
  EXPECT_FALSE(sample.extrapolated);
  EXPECT_FALSE(sample.stale);
}

TEST(PoseTrack, IsExactAtReceivedPosesAndHoldsTheOldestBeforeThem) {
  PoseTrack track;
  track.push(at(5 * kMs, 3.0));
  track.push(at(10 * kMs, 4.0));
  EXPECT_EQ(track.sample(10 * kMs, 0).pose.position_world_m.x, 4.0);
  EXPECT_EQ(track.sample(5 * kMs, 0).pose.position_world_m.x, 3.0);
  EXPECT_EQ(track.sample(0, 0).pose.position_world_m.x, 3.0);
}

TEST(PoseTrack, ExtrapolatesConstantAccelerationExactlyFromPositions) {
  // The motion is x = 2 t + 15 t^2; 1 nm covers the rounding of times to nanoseconds.
  const auto x = [](double t) { return 2.0 * t + 15.0 * t * t; };
  PoseTrack track;
  track.push(at(0, x(0.0)));
  track.push(at(7 * kMs, x(0.007)));
  track.push(at(12 * kMs, x(0.012)));
  const PoseSample sample = track.sample(30 * kMs, 50 * kMs);
  EXPECT_NEAR(sample.pose.position_world_m.x, x(0.030), 1e-9);
  EXPECT_TRUE(sample.extrapolated);
  EXPECT_FALSE(sample.stale);
}

TEST(PoseTrack, ExtrapolatesWithGivenRates) {
  TimedPose pose = at(0, 1.0, 0.1);
  pose.rates = protocol::PoseRates{{10.0, 0.0, -2.0}, {0.0, 0.0, 3.0}};
  PoseTrack track;
  track.push(pose);
  const PoseSample sample = track.sample(20 * kMs, 50 * kMs);
  EXPECT_NEAR(sample.pose.position_world_m.x, 1.2, 1e-12);
  EXPECT_NEAR(sample.pose.position_world_m.z, -0.04, 1e-12);
  EXPECT_NEAR(sample.pose.world_from_body.z, std::sin((0.1 + 0.06) / 2), 1e-12);
}

TEST(PoseTrack, DifferencesAttitudeWhenNoRateIsGiven) {
  PoseTrack track;
  track.push(at(0, 0.0, 0.0));
  track.push(at(10 * kMs, 0.0, 0.02));
  EXPECT_NEAR(track.sample(20 * kMs, 50 * kMs).pose.world_from_body.z, std::sin(0.02), 1e-12);
}

TEST(PoseTrack, ClampsTheHorizonAndSaysStale) {
  PoseTrack track;
  track.push(at(0, 0.0));
  track.push(at(10 * kMs, 1.0));
  const PoseSample at_limit = track.sample(60 * kMs, 50 * kMs);
  EXPECT_FALSE(at_limit.stale);
  const PoseSample beyond = track.sample(1000 * kMs, 50 * kMs);
  EXPECT_TRUE(beyond.stale);
  EXPECT_EQ(beyond.shown_ns, 60 * kMs);
  EXPECT_EQ(beyond.pose.position_world_m, at_limit.pose.position_world_m);
}

TEST(PoseTrack, DoesNotMoveThroughATeleport) {
  PoseTrack track;
  track.push(at(0, 0.0));
  track.push(at(10 * kMs, 1.0));
  TimedPose jump = at(20 * kMs, 500.0);
  jump.teleport = true;
  track.push(jump);
  EXPECT_EQ(track.sample(15 * kMs, 0).pose.position_world_m.x, 1.0);
  EXPECT_EQ(track.sample(20 * kMs, 0).pose.position_world_m.x, 500.0);
  EXPECT_EQ(track.sample(40 * kMs, 50 * kMs).pose.position_world_m.x, 500.0);
}

TEST(PoseTrack, SaysFromWhichReceivedPoseItStarts) {
  PoseTrack track;
  track.push(at(10 * kMs, 1.0));
  TimedPose jump = at(20 * kMs, 500.0);
  jump.teleport = true;
  track.push(jump);
  track.push(at(30 * kMs, 501.0));
  EXPECT_EQ(track.sample(5 * kMs, 0).base_ns, 10 * kMs);
  EXPECT_EQ(track.sample(19 * kMs, 0).base_ns, 10 * kMs);
  EXPECT_EQ(track.sample(20 * kMs, 0).base_ns, 20 * kMs);
  EXPECT_EQ(track.sample(25 * kMs, 0).base_ns, 20 * kMs);
  EXPECT_EQ(track.sample(30 * kMs, 0).base_ns, 30 * kMs);
  EXPECT_EQ(track.sample(35 * kMs, 50 * kMs).base_ns, 30 * kMs);
}

TEST(PoseTrack, ReplacesThePoseOfTheSameInstant) {
  PoseTrack track;
  track.push(at(0, 0.0));
  track.push(at(10 * kMs, 1.0));
  track.push(at(10 * kMs, 2.0));
  EXPECT_EQ(track.sample(10 * kMs, 0).pose.position_world_m.x, 2.0);
  EXPECT_TRUE(std::isfinite(track.sample(30 * kMs, 50 * kMs).pose.position_world_m.x));
}

TEST(ScenarioTrack, HoldsOnStateUntilTheNextKeyframeAndJumpsAtTeleports) {
  scene::Trajectory trajectory(3);
  trajectory[0] = {0, {}, true, false};
  trajectory[1] = {100, {}, false, false};
  trajectory[1].pose.position_world_m.x = 10.0;
  trajectory[2] = {200, {}, true, true};
  trajectory[2].pose.position_world_m.x = 99.0;
  scene::ScenarioDesc scenario;
  scenario.objects.resize(1);
  scenario.objects[0].entity_id = 5;
  scenario.objects[0].trajectory = trajectory;
  const ScenarioTracks tracks(scenario);
  EXPECT_EQ(tracks.entity_at(5, -5).pose.position_world_m.x, 0.0);
  EXPECT_NEAR(tracks.entity_at(5, 50).pose.position_world_m.x, 5.0, 1e-12);
  EXPECT_TRUE(tracks.entity_at(5, 50).on);
  EXPECT_FALSE(tracks.entity_at(5, 150).on);
  EXPECT_EQ(tracks.entity_at(5, 199).pose.position_world_m.x, 10.0);
  EXPECT_EQ(tracks.entity_at(5, 200).pose.position_world_m.x, 99.0);
  EXPECT_TRUE(tracks.entity_at(5, 900).on);
}

protocol::HostFrameData host(std::uint64_t number, std::int64_t time_ns, std::uint64_t run = 7) {
  protocol::HostFrameData frame;
  frame.frame_number = number;
  frame.sim_time_ns = time_ns;
  frame.run_id = run;
  return frame;
}

TEST(InputGate, CountsFramesThatNeverArrived) {
  InputGate gate;
  gate.accept(host(4, 0));
  const auto result = gate.check(host(9, 10));
  EXPECT_EQ(result.verdict, GateVerdict::accept);
  EXPECT_EQ(result.missing, 4U);
}

TEST(InputGate, TellsDuplicatesFromTimeGoingBackwardsAndFromARestart) {
  InputGate gate;
  gate.accept(host(4, 100));
  EXPECT_EQ(gate.check(host(4, 100)).verdict, GateVerdict::duplicate_frame);
  EXPECT_EQ(gate.check(host(5, 99)).verdict, GateVerdict::time_backwards);
  EXPECT_EQ(gate.check(host(3, 50)).verdict, GateVerdict::time_backwards);
  EXPECT_EQ(gate.check(host(3, 100)).verdict, GateVerdict::duplicate_frame);
  EXPECT_EQ(gate.check(host(5, 100)).verdict, GateVerdict::accept);
  EXPECT_EQ(gate.check(host(1, 0, 8)).verdict, GateVerdict::new_epoch);
  gate.reset();
  EXPECT_EQ(gate.check(host(1, 0, 9)).verdict, GateVerdict::accept);
}

TEST(InputGate, RefusesRunsThatWereReplacedUntilAReset) {
  InputGate gate;
  for (std::uint64_t run = 100; run < 100 + 3 * InputGate::kReplacedRuns; ++run) {
    EXPECT_EQ(gate.check(host(1, 0, run)).verdict,
              run == 100 ? GateVerdict::accept : GateVerdict::new_epoch);
    gate.accept(host(1, 0, run));
    gate.accept(host(2, 10, run));
    for (std::uint64_t old = 1; old <= InputGate::kReplacedRuns && run - old >= 100; ++old) {
      EXPECT_EQ(gate.check(host(3, 20, run - old)).verdict, GateVerdict::old_run);
    }
    EXPECT_EQ(gate.check(host(3, 20, run)).verdict, GateVerdict::accept);
  }
  gate.reset();
  gate.accept(host(1, 0, 7));
  EXPECT_EQ(gate.check(host(3, 20, 122)).verdict, GateVerdict::new_epoch);
}

TEST(RunControl, HoldFreezesTheThermalClockAtTheLastFrame) {
  RunControl control;
  EXPECT_EQ(control.thermal_time_ns(100, false), 100);
  ASSERT_TRUE(control.apply(CommandKind::hold));
  EXPECT_EQ(control.thermal_time_ns(200, false), 100);
  EXPECT_EQ(control.thermal_time_ns(300, false), 100);
  ASSERT_TRUE(control.apply(CommandKind::start));
  EXPECT_EQ(control.thermal_time_ns(400, false), 400);
}

TEST(RunControl, ANewRunKeepsTheHoldButNotItsInstant) {
  RunControl control;
  EXPECT_EQ(control.thermal_time_ns(1000, false), 1000);
  ASSERT_TRUE(control.apply(CommandKind::hold));
  EXPECT_EQ(control.thermal_time_ns(1100, false), 1000);
  control.new_run();
  EXPECT_TRUE(control.held());
  EXPECT_EQ(control.thermal_time_ns(5, false), 5);
  EXPECT_EQ(control.thermal_time_ns(15, false), 5);
}

TEST(RunControl, StepWhileHeldBringsTheThermalClockUpOnce) {
  RunControl control;
  EXPECT_EQ(control.thermal_time_ns(100, false), 100);
  ASSERT_TRUE(control.apply(CommandKind::hold));
  EXPECT_EQ(control.thermal_time_ns(200, false), 100);
  ASSERT_TRUE(control.apply(CommandKind::step));
  EXPECT_TRUE(control.step_pending());
  EXPECT_EQ(control.thermal_time_ns(300, true), 300);
  EXPECT_FALSE(control.step_pending());
  EXPECT_EQ(control.thermal_time_ns(400, false), 300);
}

TEST(RunControl, RefusesAStepWhileRunning) {
  RunControl control;
  EXPECT_FALSE(control.apply(CommandKind::step));
  ASSERT_TRUE(control.apply(CommandKind::stop));
  EXPECT_FALSE(control.running());
  EXPECT_TRUE(control.apply(CommandKind::step));
  ASSERT_TRUE(control.apply(CommandKind::reset));
  EXPECT_TRUE(control.running());
  EXPECT_FALSE(control.step_pending());
}

TEST(IgClock, SlotsDoNotDriftAtAnOddRate) {
  IgClock clock(300.0);
  clock.start(1000);
  for (int i = 0; i < 30'000; ++i) {
    EXPECT_EQ(clock.advance(clock.end_ns()), 0U);
  }
  EXPECT_NEAR(static_cast<double>(clock.begin_ns() - 1000), 100e9, 1.0);
}

TEST(IgClock, SkipsSlotsAfterAStallAndSaysHowMany) {
  IgClock clock(100.0);
  clock.start(0);
  const std::uint64_t skipped = clock.advance(500 * kMs);
  EXPECT_EQ(skipped, 49U);
  EXPECT_LE(clock.begin_ns(), 500 * kMs);
  EXPECT_GT(clock.end_ns(), 500 * kMs);
}

TEST(IgClock, NoticesAWallClockSetBack) {
  IgClock clock(100.0);
  clock.start(10'000 * kMs);
  EXPECT_FALSE(clock.must_restart(10'000 * kMs));
  EXPECT_TRUE(clock.must_restart(1'000 * kMs));
}

TEST(SlotPolicy, RepeatsWhenASlotEndsWithoutAnImage) {
  SlotPolicy policy;
  policy.begin(0, true);
  EXPECT_EQ(policy.end(), SlotPolicy::SlotEnd::no_image);
  policy.begin(1, true);
  ASSERT_TRUE(policy.may_issue());
  policy.issued();
  EXPECT_FALSE(policy.finished());
  EXPECT_EQ(policy.end(), SlotPolicy::SlotEnd::nothing);
  policy.begin(2, true);
  policy.issued();
  EXPECT_EQ(policy.end(), SlotPolicy::SlotEnd::repeat);
  policy.begin(3, true);
  EXPECT_FALSE(policy.may_issue()) << "one frame is in work at a time";
  EXPECT_TRUE(policy.finished()) << "an image of an earlier slot is late";
  EXPECT_EQ(policy.end(), SlotPolicy::SlotEnd::nothing);
}

TEST(SlotPolicy, SendsNothingWhileStopped) {
  SlotPolicy policy;
  policy.begin(0, true);
  policy.issued();
  EXPECT_FALSE(policy.finished());
  policy.begin(1, false);
  EXPECT_FALSE(policy.may_issue());
  EXPECT_EQ(policy.end(), SlotPolicy::SlotEnd::nothing);
}

TEST(HostStepPolicy, HasNoDeadlineWithoutABudget) {
  EXPECT_FALSE(is_past_deadline(0, 1'000'000));
  EXPECT_FALSE(is_past_deadline(100, 100));
  EXPECT_TRUE(is_past_deadline(100, 101));
}

}  // namespace
}  // namespace emit::server
