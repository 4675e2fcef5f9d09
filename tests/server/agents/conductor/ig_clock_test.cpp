// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "support/conductor_rig.hpp"

namespace emit::server {
namespace {

using test::kMs;
using test::scenario_with_entity;
using Rig = test::ConductorRig;

config::PacingConfig ig_clock(double rate_hz = 100.0) {
  config::PacingConfig pacing;
  pacing.mode = config::PacingMode::ig_clock;
  pacing.rate_hz = rate_hz;
  return pacing;
}

TEST(IgClockPacing, SendsOneFramePerSlotFromTheFirstOn) {
  Rig rig(ig_clock());
  rig.settle();
  for (int slot = 0; slot < 20; ++slot) {
    rig.next_slot();
  }
  ASSERT_EQ(rig.frames.size(), 21U);
  for (std::size_t i = 0; i < rig.frames.size(); ++i) {
    EXPECT_EQ(rig.frames[i].header.frame_number, i + 1);
    EXPECT_EQ(rig.frames[i].header.flags, protocol::kFlagStale) << "nobody steers yet";
  }
}

TEST(IgClockPacing, ShowsTheFirstTimeUntilAPoseComes) {
  Rig rig(ig_clock(), std::nullopt, false, nullptr, 12'600'000 * kMs);
  rig.settle();
  rig.next_slot();
  for (const auto& frame : rig.frames) {
    EXPECT_EQ(frame.header.sim_time_ns, 12'600'000 * kMs) << "the surface is warmed up for it";
  }
}

TEST(IgClockPacing, CannedFramesAreNotStaleBeforeTheHostHasSpoken) {
  Rig rig(ig_clock(), std::nullopt, true);
  rig.settle();
  for (int slot = 0; slot < 3; ++slot) {
    rig.next_slot();
  }
  ASSERT_EQ(rig.frames.size(), 4U);
  for (const auto& frame : rig.frames) {
    EXPECT_EQ(frame.header.flags, protocol::kFlagCanned);
  }
}

TEST(IgClockPacing, ExtrapolatesTheNewestPoseToDisplayTime) {
  auto pacing = ig_clock();
  pacing.display_delay_ns = 10 * kMs;
  Rig rig(pacing);
  rig.settle();
  rig.with([](protocol::HostFrameData& frame) {
       frame.seeker_rates = protocol::PoseRates{{100.0, 0.0, 0.0}, {}};
     })
      .send(1, 500 * kMs, 1.0);
  rig.settle();
  rig.next_slot();
  const auto& header = rig.frames.back().header;
  EXPECT_EQ(header.sim_time_ns, 520 * kMs);
  EXPECT_EQ(header.pose_sim_time_ns, 500 * kMs);
  EXPECT_NEAR(header.pose.position_world_m.x, 3.0, 1e-9);
  EXPECT_EQ(header.flags, protocol::kFlagExtrapolated);
}

TEST(IgClockPacing, FlagsStaleBeyondTheHorizonAndStopsThere) {
  Rig rig(ig_clock());
  rig.settle();
  rig.send(1, 0);
  rig.settle();
  for (int slot = 0; slot < 8; ++slot) {
    rig.next_slot();
  }
  const auto& header = rig.frames.back().header;
  EXPECT_EQ(header.sim_time_ns, 50 * kMs);
  EXPECT_EQ(header.flags, protocol::kFlagExtrapolated | protocol::kFlagStale);
}

TEST(IgClockPacing, RepeatsThePreviousFrameThenShowsTheLateOne) {
  Rig rig(ig_clock());
  rig.settle();
  rig.next_slot();  // two images so far
  rig.script.ready = false;
  rig.next_slot();
  rig.next_slot();
  rig.next_slot();
  ASSERT_EQ(rig.frames.size(), 4U);
  EXPECT_TRUE(rig.frames[2].repeat);
  EXPECT_TRUE(rig.frames[3].repeat);
  EXPECT_NE(rig.frames[3].header.flags & protocol::kFlagRepeated, 0U);
  rig.script.ready = true;
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 5U);
  EXPECT_FALSE(rig.frames[4].repeat);
  EXPECT_NE(rig.frames[4].header.flags & protocol::kFlagLate, 0U);
  rig.next_slot();
  EXPECT_EQ(rig.frames.size(), 6U) << "the slot of the late image is not filled twice";
  for (std::size_t i = 0; i < rig.frames.size(); ++i) {
    EXPECT_EQ(rig.frames[i].header.frame_number, i + 1);
  }
  EXPECT_EQ(rig.frames[5].header.flags & (protocol::kFlagLate | protocol::kFlagRepeated), 0U);
}

/// Checks the frames of the next `slots` slots: there is one each, none twice, none more.
void expect_a_frame_per_slot(Rig& rig, int slots) {
  for (int slot = 0; slot < slots; ++slot) {
    const std::size_t before = rig.frames.size();
    rig.next_slot();
    ASSERT_EQ(rig.frames.size(), before + 1) << slot;
    EXPECT_FALSE(rig.frames.back().repeat) << slot;
  }
}

TEST(IgClockPacing, AWallClockSetForwardSkipsItsSlotsInsteadOfABurstOfFrames) {
  Rig rig(ig_clock());
  rig.settle();
  rig.send(1, 0);
  ASSERT_NO_FATAL_FAILURE(expect_a_frame_per_slot(rig, 5));
  const std::size_t before = rig.frames.size();
  rig.clock.step_wall(10'000 * kMs);
  rig.settle();
  EXPECT_LE(rig.frames.size(), before + 2) << "the slot that ended and the one that began";
  EXPECT_GE(rig.count(server::Counter::slots_missed), 998U);
  EXPECT_LE(rig.count(server::Counter::slots_missed), 1000U);
  for (int slot = 0; slot < 5; ++slot) {
    const std::size_t count = rig.frames.size();
    rig.clock.advance(10 * kMs);
    rig.settle();
    EXPECT_EQ(rig.frames.size(), count + 1);
  }
  EXPECT_NE(rig.frames.back().header.flags & protocol::kFlagStale, 0U)
      << "by the new clock the pose is old";
  rig.send(2, 100 * kMs);
  rig.settle();
  rig.clock.advance(10 * kMs);
  rig.settle();
  EXPECT_EQ(rig.frames.back().header.flags & protocol::kFlagStale, 0U);
  for (std::size_t i = 0; i < rig.frames.size(); ++i) {
    EXPECT_EQ(rig.frames[i].header.frame_number, i + 1);
  }
}

TEST(IgClockPacing, AWallClockSetBackStartsItsSlotsAnewInsteadOfWaiting) {
  Rig rig(ig_clock());
  rig.settle();
  rig.send(1, 0);
  ASSERT_NO_FATAL_FAILURE(expect_a_frame_per_slot(rig, 5));
  rig.clock.step_wall(-10'000 * kMs);
  rig.settle();
  std::int64_t sim_ns = rig.frames.back().header.sim_time_ns;
  for (int slot = 0; slot < 5; ++slot) {
    const std::size_t count = rig.frames.size();
    rig.clock.advance(10 * kMs);
    rig.settle();
    EXPECT_EQ(rig.frames.size(), count + 1) << slot;
    EXPECT_GE(rig.frames.back().header.sim_time_ns, sim_ns) << "nothing moves backwards";
    sim_ns = rig.frames.back().header.sim_time_ns;
  }
  for (std::size_t i = 0; i < rig.frames.size(); ++i) {
    EXPECT_EQ(rig.frames[i].header.frame_number, i + 1);
  }
}

TEST(IgClockPacing, FlagsATeleportWithTheFirstPoseBehindIt) {
  Rig rig(ig_clock());
  rig.settle();
  const auto entity_at = [](double x_m, bool teleport, std::int64_t early_ns) {
    return [=](protocol::HostFrameData& frame) {
      // The stamp is ahead of the slot: its display time lies before this frame's simulation time.
      frame.received_ns += early_ns;
      frame.entity_count = 1;
      frame.entities[0].entity_id = 3;
      frame.entities[0].has_pose = true;
      frame.entities[0].pose.position_world_m.x = x_m;
      frame.entities[0].teleport = teleport;
    };
  };
  rig.with(entity_at(1.0, false, 0)).send(1, 100 * kMs);
  rig.settle();
  rig.next_slot();
  rig.with(entity_at(500.0, true, 25 * kMs)).send(2, 200 * kMs);
  rig.settle();
  for (int slot = 0; slot < 4; ++slot) {
    rig.next_slot();
  }
  ASSERT_EQ(rig.script.entities.size(), 5U);
  const auto times_ns = std::array{185 * kMs, 195 * kMs, 205 * kMs, 215 * kMs};
  for (std::size_t i = 0; i < times_ns.size(); ++i) {
    const auto& [time_ns, updates] = rig.script.entities[i + 1];
    EXPECT_EQ(time_ns, times_ns[i]);
    ASSERT_EQ(updates.size(), 1U);
    EXPECT_EQ(updates[0].pose.position_world_m.x, i < 2 ? 1.0 : 500.0) << i;
    EXPECT_EQ(updates[0].teleport, i == 2) << i;
  }
}

TEST(IgClockPacing, TakesInputsWithWeatherWhileARenderIsSlow) {
  Rig rig(ig_clock());
  rig.settle();
  constexpr std::uint64_t kFrames = kMaxWeatherPerFrame + 10;
  for (std::uint64_t k = 1; k <= kFrames; ++k) {
    rig.with([&](protocol::HostFrameData& frame) {
         frame.environment.emplace();
         frame.environment->air_k = 200.0 + static_cast<double>(k);
       })
        .send(k, static_cast<std::int64_t>(k) * kMs, static_cast<double>(k));
    rig.settle_without_render();
    ASSERT_EQ(rig.context().host_inputs.front(), nullptr) << "input " << k << " waits";
  }
  rig.next_slot();
  EXPECT_EQ(rig.frames.back().header.host_frame_number, kFrames);
  ASSERT_EQ(rig.script.weather.size(), kMaxWeatherPerFrame);
  EXPECT_EQ(rig.script.weather.front().air_k, 201.0);
  EXPECT_EQ(rig.script.weather.back().air_k, 200.0 + static_cast<double>(kFrames));
  EXPECT_EQ(rig.count(Counter::weather_coalesced), 10U);
}

TEST(IgClockPacing, AnEntityWithoutAPoseStaysWhereItIs) {
  auto scenario = scenario_with_entity(3);
  auto& trajectory = scenario.objects[0].trajectory;
  trajectory.resize(2);
  trajectory[1].sim_time_ns = 1000 * kMs;
  trajectory[1].pose.position_world_m.x = 1000.0;
  Rig rig(ig_clock(), scenario);
  rig.settle();
  const auto state = [](std::optional<double> x_m) {
    return [=](protocol::HostFrameData& frame) {
      frame.entity_count = 1;
      frame.entities[0].entity_id = 3;
      frame.entities[0].has_pose = x_m.has_value();
      frame.entities[0].pose.position_world_m.x = x_m.value_or(0.0);
    };
  };
  const auto shown_x_m = [&] {
    return rig.script.entities.back().second[0].pose.position_world_m.x;
  };
  rig.with(state(std::nullopt)).send(1, 100 * kMs);
  rig.settle();
  for (int slot = 0; slot < 3; ++slot) {
    rig.next_slot();
    EXPECT_NEAR(shown_x_m(), 100.0, 1e-9) << "where the scenario had it when the host spoke";
  }
  rig.with(state(150.0)).send(2, 150 * kMs);
  rig.settle();
  rig.next_slot();
  rig.with(state(160.0)).send(3, 160 * kMs);
  rig.settle();
  rig.next_slot();
  EXPECT_GT(shown_x_m(), 160.0) << "predicted";
  rig.with(state(std::nullopt)).send(4, 170 * kMs);
  rig.settle();
  for (int slot = 0; slot < 3; ++slot) {
    rig.next_slot();
    EXPECT_EQ(shown_x_m(), 160.0) << "no motion any more";
    EXPECT_FALSE(rig.script.entities.back().second[0].teleport);
  }
}

TEST(IgClockPacing, SimTimeNeverGoesBackwardsUnderJitter) {
  Rig rig(ig_clock());
  rig.settle();
  std::int64_t last_ns = 0;
  for (std::uint64_t k = 1; k <= 40; ++k) {
    // Every other pose arrives 6 ms late.
    rig.clock.advance(k % 2 == 0 ? 6 * kMs : 0);
    rig.send(k, static_cast<std::int64_t>(k) * 10 * kMs);
    rig.settle();
    rig.next_slot();
    EXPECT_GE(rig.frames.back().header.sim_time_ns, last_ns);
    last_ns = rig.frames.back().header.sim_time_ns;
  }
}

}  // namespace
}  // namespace emit::server
