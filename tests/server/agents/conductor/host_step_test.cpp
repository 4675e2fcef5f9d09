// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "support/conductor_rig.hpp"

namespace emit::server {
namespace {

using test::kMs;
using test::scenario_with_entity;
using Rig = test::ConductorRig;

TEST(HostStep, SendsFrameKForPoseKWithoutGaps) {
  Rig rig;
  for (std::uint64_t k = 1; k <= 50; ++k) {
    rig.send(k + 10, static_cast<std::int64_t>(k) * 5 * kMs, static_cast<double>(k));
    rig.settle();
  }
  ASSERT_EQ(rig.frames.size(), 50U);
  for (std::uint64_t k = 1; k <= 50; ++k) {
    const auto& header = rig.frames[k - 1].header;
    EXPECT_EQ(header.frame_number, k);
    EXPECT_EQ(header.host_frame_number, k + 10);
    EXPECT_EQ(header.sim_time_ns, static_cast<std::int64_t>(k) * 5 * kMs);
    EXPECT_EQ(header.pose.position_world_m.x, static_cast<double>(k));
    EXPECT_EQ(header.flags, 0U);
  }
}

TEST(HostStep, ShowsTheFieldOfViewThatTheHostHasSetUntilItSetsAnother) {
  Rig rig;
  const auto zoom = [](double fov_h_rad) {
    return [fov_h_rad](protocol::HostFrameData& frame) { frame.fov_h_rad = fov_h_rad; };
  };
  rig.send(1, 0);
  rig.with(zoom(0.25)).send(2, kMs);
  rig.send(3, 2 * kMs);
  rig.with(zoom(test::kFovMinRad)).send(4, 3 * kMs);
  rig.settle();
  // A new run begins with the field of view of the scenario.
  rig.send(1, 0, 0.0, 2);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 5U);
  const std::vector<double> expected = {test::kFovRad, 0.25, 0.25, test::kFovMinRad, test::kFovRad};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(rig.frames[i].header.fov_h_rad, static_cast<float>(expected[i])) << i;
    EXPECT_EQ(rig.script.submitted[i].fov_h_rad, expected[i]) << i;
  }
  EXPECT_TRUE(rig.replies.empty());
}

TEST(HostStep, RefusesAFieldOfViewThatTheSensorCannotHaveAndTakesTheRestOfTheFrame) {
  Rig rig;
  std::uint64_t number = 0;
  for (const double fov_h_rad : {test::kFovRad * 1.001, test::kFovMinRad * 0.999, 0.0, -1.0,
                                 std::numeric_limits<double>::quiet_NaN()}) {
    ++number;
    rig.with([&](protocol::HostFrameData& frame) { frame.fov_h_rad = fov_h_rad; })
        .send(number, static_cast<std::int64_t>(number) * kMs);
    rig.settle();
    ASSERT_EQ(rig.replies.size(), number) << fov_h_rad;
    EXPECT_EQ(rig.replies.back().code, StatusCode::invalid_view);
    EXPECT_EQ(rig.replies.back().host_frame_number, number);
    ASSERT_EQ(rig.frames.size(), number);
    EXPECT_EQ(rig.frames.back().header.fov_h_rad, static_cast<float>(test::kFovRad));
  }
  EXPECT_EQ(rig.count(Counter::refused_invalid_view), number);
}

TEST(HostStep, HandsCommandsToPartsOnWithTheFrameAndRefusesPartsThatAreNot) {
  using Kind = protocol::PartCommandData::Kind;
  scene::ScenarioDesc scenario = scenario_with_entity(7);
  scene::PartDesc engine;
  engine.id = 3;
  engine.curve.given = true;
  scene::PartDesc skin;
  skin.id = 4;
  scenario.objects.front().parts = {engine, skin};
  Rig rig({}, scenario);
  rig.with([](protocol::HostFrameData& frame) {
       frame.parts[0] = {7, 3, Kind::throttle, 0.5};
       frame.parts[1] = {7, 4, Kind::throttle, 0.5};  // takes none
       frame.parts[2] = {7, 4, Kind::power, 80.0};
       frame.parts[3] = {8, 3, Kind::off, 0.0};  // no such entity
       frame.part_count = 4;
     })
      .send(1, kMs);
  rig.settle();
  rig.send(2, 2 * kMs);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  ASSERT_EQ(rig.script.parts.size(), 2U);
  EXPECT_EQ(rig.script.parts[0].first, kMs);
  EXPECT_EQ(rig.script.parts[0].second.part_id, 3U);
  EXPECT_EQ(rig.script.parts[0].second.command,
            (scene::PartCommand{scene::PartCommand::Kind::throttle, 0.5}));
  EXPECT_EQ(rig.script.parts[1].second.command,
            (scene::PartCommand{scene::PartCommand::Kind::power, 80.0}));
  ASSERT_EQ(rig.replies.size(), 2U);
  EXPECT_EQ(rig.replies[0].code, StatusCode::unknown_part);
  EXPECT_EQ(rig.replies[0].detail, protocol::part_detail(7, 4));
  EXPECT_EQ(rig.replies[1].detail, protocol::part_detail(8, 3));
  EXPECT_EQ(rig.count(Counter::refused_unknown_part), 2U);
}

TEST(HostStep, GivesTheSamePixelsWhateverTheTiming) {
  const auto run = [](bool one_by_one) {
    Rig rig;
    for (std::uint64_t k = 1; k <= 12; ++k) {
      rig.send(k, static_cast<std::int64_t>(k) * kMs, static_cast<double>(k));
      if (one_by_one) {
        rig.settle();
        rig.clock.advance(123'456);
      }
    }
    rig.settle();
    std::vector<std::uint32_t> sums;
    for (const auto& frame : rig.frames) {
      sums.push_back(frame.image.crc32c[0]);
    }
    return sums;
  };
  const auto stepped = run(true);
  EXPECT_EQ(stepped.size(), 12U);
  EXPECT_EQ(stepped, run(false));
}

TEST(HostStep, FlagsALateFrameAndSendsItAllTheSame) {
  config::PacingConfig pacing;
  pacing.budget_ns = 3 * kMs;
  Rig rig(pacing);
  rig.script.ready = false;
  rig.send(1, 0);
  rig.settle();
  EXPECT_TRUE(rig.frames.empty());
  rig.clock.advance(4 * kMs);
  rig.script.ready = true;
  rig.settle();
  rig.send(2, kMs);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_EQ(rig.frames[0].header.flags, protocol::kFlagLate);
  EXPECT_FALSE(rig.frames[0].repeat);
  EXPECT_EQ(rig.frames[1].header.flags, 0U);
  EXPECT_EQ(rig.count(Counter::frames_late), 1U);
}

TEST(HostStep, ShedsWorkToBeInTimeSaysSoAndStopsSheddingAfterwards) {
  config::PacingConfig pacing;
  pacing.budget_ns = 3 * kMs;
  Rig rig(pacing);
  rig.script.quality_levels = {{2.5, 0.0}, {1.2, 0.25}, {0.5, 2.0}};
  const auto frame = [&](std::uint64_t number, std::int64_t work_ns) {
    rig.script.ready = false;
    rig.send(number, static_cast<std::int64_t>(number) * kMs);
    rig.settle();
    rig.clock.advance(work_ns);
    rig.script.ready = true;
    rig.settle();
  };
  frame(1, 3100 * kMs / 1000);  // longer than was measured
  frame(2, 1 * kMs);
  frame(3, 5 * kMs);  // and again
  frame(4, 1 * kMs);
  ASSERT_EQ(rig.frames.size(), 4U);
  EXPECT_EQ(rig.frames[0].header.flags, protocol::kFlagLate);
  EXPECT_EQ(rig.frames[0].header.quality_rung, 0U);
  EXPECT_EQ(rig.frames[1].header.flags, protocol::kFlagDegraded);
  EXPECT_EQ(rig.frames[1].header.quality_rung, 1U);
  EXPECT_EQ(rig.frames[1].header.estimated_error_k, 0.25F);
  EXPECT_EQ(rig.frames[2].header.flags, protocol::kFlagDegraded | protocol::kFlagLate);
  EXPECT_EQ(rig.frames[3].header.quality_rung, 2U);
  EXPECT_EQ(rig.frames[3].header.estimated_error_k, 2.0F);
  EXPECT_EQ(rig.count(Counter::frames_shed), 3U);
  for (std::uint64_t k = 5; k < 140; ++k) frame(k, kMs / 5);
  EXPECT_EQ(rig.frames.back().header.flags, 0U);
  EXPECT_EQ(rig.frames.back().header.quality_rung, 0U);
}

TEST(HostStep, SaysThatItWaitsForASlotOrForRoom) {
  Rig rig;
  rig.send(1, 0);
  rig.settle_without_sender();
  EXPECT_FALSE(rig.context().of_slots.end()) << "there are six more";
  for (std::uint64_t number = 2; number <= 8; ++number) {
    rig.send(number, static_cast<std::int64_t>(number) * kMs);
    rig.settle_without_sender();
  }
  EXPECT_TRUE(rig.context().of_slots.end());
  EXPECT_FALSE(rig.context().of_room.end());
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 8U);

  while (rig.context().published.push({})) {
  }
  rig.send(9, 9 * kMs);
  rig.settle_without_sender();
  EXPECT_TRUE(rig.context().of_room.end());
  while (rig.context().published.front() != nullptr) {
    rig.context().published.pop();
  }
  rig.settle();
  EXPECT_EQ(rig.frames.size(), 9U);
}

TEST(HostStep, WithoutBudgetNothingIsShed) {
  Rig rig;
  rig.script.quality_levels = {{2.5, 0.0}, {1.2, 0.25}};
  for (std::uint64_t k = 1; k < 5; ++k) {
    rig.script.ready = false;
    rig.send(k, static_cast<std::int64_t>(k) * kMs);
    rig.settle();
    rig.clock.advance(1000 * kMs);
    rig.script.ready = true;
    rig.settle();
    EXPECT_EQ(rig.frames.back().header.flags, 0U);
  }
}

TEST(HostStep, AStepHasItsBudgetFromTheCommandOn) {
  config::PacingConfig pacing;
  pacing.budget_ns = 3 * kMs;
  Rig rig(pacing);
  rig.send(1, 0);
  rig.settle();
  rig.command(CommandKind::stop);
  rig.settle();
  rig.clock.advance(5000 * kMs);
  rig.command(CommandKind::step);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  const auto& header = rig.frames[1].header;
  EXPECT_EQ(header.host_frame_number, 1U);
  EXPECT_EQ(header.flags & protocol::kFlagLate, 0U);
  EXPECT_EQ(header.host_received_ns, rig.clock.tai_ns());
  EXPECT_EQ(header.deadline_ns, rig.clock.tai_ns() + 3 * kMs);
}

TEST(HostStep, ADelayedPacketOfTheReplacedRunResetsNothing) {
  Rig rig;
  rig.send(100, 1000, 0.0, 1);
  rig.send(1, 0, 0.0, 2);
  rig.send(101, 1010, 0.0, 1);
  rig.send(2, 10, 0.0, 2);
  rig.settle();
  EXPECT_EQ(rig.script.resets, 1);
  ASSERT_EQ(rig.frames.size(), 3U);
  EXPECT_EQ(rig.frames[1].header.run_id, rig.frames[2].header.run_id);
  ASSERT_EQ(rig.replies.size(), 1U);
  EXPECT_EQ(rig.replies[0].code, StatusCode::not_allowed);
  EXPECT_EQ(rig.replies[0].host_frame_number, 101U);
  EXPECT_NE(status_text(rig.replies[0].code, rig.replies[0].detail).find("new run id"),
            std::string::npos);
  EXPECT_EQ(rig.count(Counter::host_frames_old_run), 1U);
  EXPECT_EQ(rig.count(Counter::refused_not_allowed), 1U);
  rig.command(CommandKind::reset);
  rig.send(1, 0, 0.0, 1);
  rig.settle();
  EXPECT_EQ(rig.frames.size(), 4U) << "after a reset any run is welcome";
}

TEST(HostStep, AHeldRunOfARestartedHostStartsAtItsOwnInstant) {
  Rig rig;
  rig.send(1, 1000 * kMs, 0.0, 1);
  rig.command(CommandKind::hold);
  rig.send(2, 1010 * kMs, 0.0, 1);
  rig.send(1, 20 * kMs, 0.0, 2);
  rig.send(2, 30 * kMs, 0.0, 2);
  rig.settle();
  ASSERT_EQ(rig.script.submitted.size(), 4U);
  EXPECT_EQ(rig.script.submitted[1].thermal_time_ns, 1000 * kMs);
  EXPECT_EQ(rig.script.submitted[2].thermal_time_ns, 20 * kMs);
  EXPECT_EQ(rig.script.submitted[3].thermal_time_ns, 20 * kMs);
}

TEST(HostStep, AnswersRefusedFramesAndGoesOn) {
  Rig rig;
  rig.send(5, 100);
  rig.send(5, 100);
  rig.send(6, 99);
  rig.send(7, 100);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  ASSERT_EQ(rig.replies.size(), 2U);
  EXPECT_EQ(rig.replies[0].code, StatusCode::duplicate_frame);
  EXPECT_EQ(rig.replies[0].host_frame_number, 5U);
  EXPECT_EQ(rig.replies[1].code, StatusCode::time_backwards);
  EXPECT_EQ(rig.replies[1].count, 1U);
  EXPECT_EQ(rig.count(Counter::host_frames_missing), 1U);
}

TEST(HostStep, AppliesKnownEntitiesAndNamesUnknownOnes) {
  Rig rig({}, scenario_with_entity(3));
  rig.with([](protocol::HostFrameData& frame) {
       frame.entity_count = 2;
       frame.entities[0].entity_id = 44;
       frame.entities[0].has_pose = true;
       frame.entities[1].entity_id = 3;
       frame.entities[1].on = false;
     })
      .send(1, 10);
  rig.settle();
  ASSERT_EQ(rig.replies.size(), 1U);
  EXPECT_EQ(rig.replies[0].code, StatusCode::unknown_entity);
  EXPECT_EQ(rig.replies[0].detail, 44U);
  ASSERT_EQ(rig.script.entities.size(), 1U);
  const auto& [time_ns, updates] = rig.script.entities[0];
  EXPECT_EQ(time_ns, 10);
  ASSERT_EQ(updates.size(), 1U);
  EXPECT_EQ(updates[0].entity_id, 3U);
  EXPECT_FALSE(updates[0].on);
  EXPECT_EQ(updates[0].pose.position_world_m.x, 5.0) << "stays where the scenario put it";
  EXPECT_EQ(rig.frames.size(), 1U);
}

TEST(HostStep, HandsWeatherOverBeforeTheFrameThatBroughtIt) {
  Rig rig;
  rig.with([](protocol::HostFrameData& frame) {
       frame.environment.emplace();
       frame.environment->air_k = 280.0;
     })
      .send(1, 30);
  rig.settle();
  ASSERT_EQ(rig.script.weather.size(), 1U);
  EXPECT_EQ(rig.script.weather[0].sim_time_ns, 30);
  EXPECT_EQ(rig.script.order, (std::vector<std::string>{"weather", "submit"}));
}

TEST(HostStep, StopTakesInputsButSendsNothingUntilStep) {
  Rig rig;
  rig.send(1, 10);
  rig.command(CommandKind::stop);
  rig.with([](protocol::HostFrameData& frame) {
       frame.entity_count = 1;
       frame.entities[0].entity_id = 9;
       frame.entities[0].has_pose = true;
       frame.entities[0].pose.position_world_m.x = 77.0;
     })
      .send(2, 20);
  rig.send(3, 30);
  rig.settle();
  EXPECT_EQ(rig.frames.size(), 1U);
  EXPECT_EQ(rig.count(Counter::host_frames_unused), 2U);
  ASSERT_EQ(rig.replies.size(), 3U) << "the command and every pose have an answer";
  EXPECT_EQ(rig.replies[2].code, StatusCode::ok);
  EXPECT_EQ(rig.replies[2].host_frame_number, 3U);
  EXPECT_NE(protocol::status_text(rig.replies[2].code, rig.replies[2].detail).find("stopped"),
            std::string::npos);
  rig.command(CommandKind::step);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_EQ(rig.frames[1].header.sim_time_ns, 30);
  ASSERT_EQ(rig.script.entities.size(), 1U) << "what moved meanwhile comes with the next frame";
  EXPECT_EQ(rig.script.entities[0].second[0].pose.position_world_m.x, 77.0);
  rig.command(CommandKind::start);
  rig.send(4, 40);
  rig.settle();
  EXPECT_EQ(rig.frames.size(), 3U);
}

TEST(HostStep, HoldFreezesThermalTimeAndFlagsFrames) {
  Rig rig;
  rig.send(1, 10);
  rig.command(CommandKind::hold);
  rig.send(2, 20);
  rig.settle();
  ASSERT_EQ(rig.script.submitted.size(), 2U);
  EXPECT_EQ(rig.script.submitted[1].thermal_time_ns, 10);
  EXPECT_EQ(rig.script.submitted[1].sim_time_ns, 20);
  EXPECT_EQ(rig.frames[1].header.flags, protocol::kFlagHold);
}

TEST(HostStep, StartEndsStopAndHold) {
  Rig rig;
  rig.send(1, 10);
  rig.command(CommandKind::hold);
  rig.command(CommandKind::stop);
  rig.command(CommandKind::start);
  rig.send(2, 20);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_EQ(rig.frames[1].header.flags, 0U);
  EXPECT_EQ(rig.script.submitted[1].thermal_time_ns, 20);
}

TEST(HostStep, ResetBeginsANewRunWithAFreshSource) {
  Rig rig;
  rig.send(1, 10);
  rig.send(2, 20);
  rig.command(CommandKind::reset);
  rig.send(1, 0);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 3U);
  EXPECT_EQ(rig.script.resets, 1);
  EXPECT_GT(rig.frames[2].header.run_id, rig.frames[1].header.run_id);
  EXPECT_EQ(rig.frames[2].header.frame_number, 1U);
  ASSERT_EQ(rig.replies.size(), 1U);
  EXPECT_EQ(rig.replies[0].code, StatusCode::ok);
}

TEST(HostStep, TakesARestartedHostAsANewRun) {
  Rig rig;
  rig.send(100, 1000, 0.0, 1);
  rig.send(1, 0, 0.0, 2);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  EXPECT_EQ(rig.script.resets, 1);
  EXPECT_NE(rig.frames[0].header.run_id, rig.frames[1].header.run_id);
  EXPECT_TRUE(rig.replies.empty());
}

TEST(HostStep, RefusesAStepBeforeAnyPose) {
  Rig rig;
  rig.command(CommandKind::stop);
  rig.command(CommandKind::step);
  rig.settle();
  ASSERT_EQ(rig.replies.size(), 2U);
  EXPECT_EQ(rig.replies[1].code, StatusCode::not_allowed);
}

}  // namespace
}  // namespace emit::server
