// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "support/conductor_rig.hpp"
#include "support/times.hpp"
#include "telemetry/log.hpp"

namespace emit::server {
namespace {

using Rig = test::ConductorRig;

TEST(Conductor, DrainsWhatIsInWork) {
  Rig rig;
  rig.script.ready = false;
  rig.send(1, 10);
  rig.settle();
  rig.conductor().drain();
  rig.send(2, 20);
  rig.settle();
  EXPECT_FALSE(rig.conductor().drained());
  rig.script.ready = true;
  rig.settle();
  EXPECT_TRUE(rig.conductor().drained());
  EXPECT_EQ(rig.frames.size(), 1U);
}

TEST(RenderAgent, SaysOnceWhenTheSourceHasNoRoomForWeather) {
  Rig rig;
  rig.script.weather_full = true;
  for (std::uint64_t k = 1; k <= 5; ++k) {
    rig.with([](protocol::HostFrameData& frame) { frame.environment.emplace(); })
        .send(k, static_cast<std::int64_t>(k));
    rig.settle();
  }
  EXPECT_EQ(rig.count(Counter::weather_lost), 5U);
  EXPECT_EQ(rig.frames.size(), 5U);
  auto& events = rig.context().render_events.ring();
  ASSERT_NE(events.front(), nullptr);
  EXPECT_EQ(events.front()->kind, EventKind::weather_lost);
  EXPECT_EQ(events.front()->a, 1U);
  EXPECT_NE(describe(*events.front()).text.find("event=weather_lost"), std::string::npos);
  events.pop();
  EXPECT_EQ(events.front(), nullptr);
}

TEST(Conductor, CountsJournalLinesThatFindNoRoomAndKeepsOnSendingFrames) {
  Rig rig;
  for (std::uint64_t k = 1; k <= 3000; ++k) {
    rig.send(k, static_cast<std::int64_t>(k));
    rig.settle();
  }
  EXPECT_EQ(rig.frames.size(), 3000U);
  EXPECT_GT(rig.count(Counter::journal_dropped), 0U);
}

TEST(RenderAgent, FramesOfASurfaceThatIsTooCoarseAreDegradedAndCountedByReasonAndToldOnce) {
  const Counter counters[] = {Counter::frames_coarse_camera,  Counter::frames_coarse_fov,
                              Counter::frames_coarse_samples, Counter::frames_coarse_meshes,
                              Counter::frames_coarse_shade,   Counter::frames_coarse_shadows,
                              Counter::frames_coarse_weather, Counter::frames_coarse_edges};
  // A frame that warms up again is told by an event of its own.
  ASSERT_EQ(std::size(counters) + 1, renderer::kCoarseReasons);
  for (std::size_t reason = 0; reason < renderer::kCoarseReasons; ++reason) {
    SCOPED_TRACE(reason);
    Rig rig;
    rig.send(1, 1);
    rig.settle();
    rig.script.coarse.set(reason);
    rig.send(2, 2);
    rig.settle();
    rig.send(3, 3);
    rig.settle();
    rig.script.coarse.reset();
    rig.send(4, 4);
    rig.settle();
    ASSERT_EQ(rig.frames.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
      const bool coarse = i == 1 || i == 2;
      EXPECT_EQ((rig.frames[i].header.flags & protocol::kFlagDegraded) != 0U, coarse);
      EXPECT_EQ(std::isnan(rig.frames[i].header.estimated_error_k), coarse);
    }
    EXPECT_EQ(rig.count(Counter::frames_coarse), 2U);
    for (std::size_t i = 0; i < std::size(counters); ++i) {
      EXPECT_EQ(rig.count(counters[i]), i == reason ? 2U : 0U) << i;
    }
    auto& events = rig.context().render_events.ring();
    if (reason < std::size(counters)) {
      ASSERT_NE(events.front(), nullptr);
      const std::string sentence(renderer::text_of(static_cast<renderer::CoarseReason>(reason)));
      EXPECT_NE(describe(*events.front()).text.find("event=coarse why=\"" + sentence + "\""),
                std::string::npos);
      events.pop();
    }
    EXPECT_EQ(events.front(), nullptr);
  }
}

TEST(RenderAgent, EachLimitOfTheHeatIsCountedByItsNameAndToldOnceInARun) {
  const Counter counters[] = {
      Counter::frames_wet_unknown, Counter::frames_rain_shelter, Counter::frames_snowfall,
      Counter::frames_freezing,    Counter::frames_melting,      Counter::frames_humidity_unknown,
      Counter::frames_strong_wind, Counter::frames_longwave_low, Counter::frames_layers_invalid};
  ASSERT_EQ(std::size(counters), renderer::kHeatLimits);
  for (std::size_t i = 0; i < renderer::kHeatLimits; ++i) {
    SCOPED_TRACE(i);
    Rig rig;
    rig.send(1, 1);
    rig.settle();
    rig.script.heat_limits.set(i);
    rig.send(2, 2);
    rig.settle();
    rig.send(3, 3);
    rig.settle();
    ASSERT_EQ(rig.frames.size(), 3U);
    for (std::size_t f = 0; f < 3; ++f) {
      EXPECT_EQ((rig.frames[f].header.flags & protocol::kFlagDegraded) != 0U, f > 0);
      EXPECT_EQ(std::isnan(rig.frames[f].header.estimated_error_k), f > 0);
    }
    for (std::size_t other = 0; other < renderer::kHeatLimits; ++other) {
      EXPECT_EQ(rig.count(counters[other]), other == i ? 2U : 0U) << other;
    }
    auto& events = rig.context().render_events.ring();
    ASSERT_NE(events.front(), nullptr);
    EXPECT_EQ(events.front()->kind, EventKind::heat_limit);
    const std::string sentence(renderer::text_of(static_cast<renderer::HeatLimit>(i)));
    EXPECT_NE(describe(*events.front()).text.find("event=heat_limit why=\"" + sentence + "\""),
              std::string::npos);
    events.pop();
    EXPECT_EQ(events.front(), nullptr);
  }
}

TEST(RenderAgent, FramesWithMoreSmallTargetsThanWindowsAreDegradedAndCounted) {
  Rig rig;
  rig.script.plain_targets = 3;
  rig.send(1, 1);
  rig.settle();
  rig.script.plain_targets = 0;
  rig.send(2, 2);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 2U);
  for (const std::size_t i : {0U, 1U}) {
    EXPECT_EQ((rig.frames[i].header.flags & protocol::kFlagDegraded) != 0U, i == 0U);
    EXPECT_EQ(std::isnan(rig.frames[i].header.estimated_error_k), i == 0U);
  }
  EXPECT_EQ(rig.count(Counter::targets_plain), 3U);
  EXPECT_EQ(rig.count(Counter::frames_coarse), 0U);
}

TEST(RenderAgent, AFrameInWhichTheSurfaceWarmsUpAgainIsDegradedCountedAndLogged) {
  using emit::test::kSecondNs;
  struct Case {
    std::int64_t to_ns;    // simulation time of the second frame
    std::int64_t took_ns;  // of its submit()
    bool warm_up;
  };
  for (const Case& each :
       {Case{3600 * kSecondNs, 400'000'000, true},      // forward
        Case{-3600 * kSecondNs, 19'600'000'000, true},  // a new run that is earlier
        Case{3600 * kSecondNs, 50'000'000, false},      // a source without surface
        Case{10'000'000, 400'000'000, false}}) {        // a slow frame, no jump
    SCOPED_TRACE(each.to_ns);
    Rig rig;
    std::int64_t passes_ns = 0;
    bool ready_meanwhile = true;
    rig.script.on_submit = [&](const renderer::FrameRequest&) {
      rig.clock.advance(passes_ns);
      const std::int64_t since_ns = rig.context().jump_since_ns.load();
      ready_meanwhile = since_ns == 0 || !warms_up_again(rig.clock.monotonic_ns() - since_ns);
    };
    rig.send(1, 0);
    rig.settle();
    passes_ns = each.took_ns;
    rig.send(2, each.to_ns, 0.0, each.to_ns < 0 ? 2 : 1);
    rig.settle();
    EXPECT_EQ(ready_meanwhile, !each.warm_up);
    EXPECT_EQ(rig.context().jump_since_ns.load(), 0);
    passes_ns = 0;
    rig.send(3, each.to_ns + 1, 0.0, each.to_ns < 0 ? 2 : 1);
    rig.settle();
    ASSERT_EQ(rig.frames.size(), 3U);
    for (const std::size_t i : {0U, 1U, 2U}) {
      const bool degraded = (rig.frames[i].header.flags & protocol::kFlagDegraded) != 0U;
      EXPECT_EQ(degraded, each.warm_up && i == 1U) << i;
    }
    EXPECT_EQ(rig.count(Counter::frames_warmed_up), each.warm_up ? 1U : 0U);
    const Event* event = rig.context().render_events.ring().front();
    ASSERT_EQ(event != nullptr, each.warm_up);
    if (event != nullptr) {
      EXPECT_NE(describe(*event).text.find("event=warmed_up_again"), std::string::npos);
    }
  }
}

TEST(RenderAgent, AFirstPoseFarFromTheWarmUpIsAWarmUpToo) {
  using emit::test::kSecondNs;
  Rig rig;
  rig.script.on_submit = [&](const renderer::FrameRequest&) { rig.clock.advance(kSecondNs); };
  rig.send(1, 3600 * kSecondNs);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 1U);
  EXPECT_NE(rig.frames[0].header.flags & protocol::kFlagDegraded, 0U);
  EXPECT_EQ(rig.count(Counter::frames_warmed_up), 1U);
}

TEST(RenderAgent, CountsForgottenPosesAndTheirFramesAreDegraded) {
  Rig rig;
  rig.send(1, 1);
  rig.settle();
  EXPECT_EQ(rig.frames[0].header.flags & protocol::kFlagDegraded, 0U);
  rig.script.dropped_poses = 4096;
  rig.send(2, 2);
  rig.settle();
  rig.script.dropped_poses = 5000;
  rig.send(3, 3);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 3U);
  for (const std::size_t i : {1U, 2U}) {
    EXPECT_NE(rig.frames[i].header.flags & protocol::kFlagDegraded, 0U);
    EXPECT_TRUE(std::isnan(rig.frames[i].header.estimated_error_k)) << "nobody knows how much";
  }
  EXPECT_EQ(rig.count(Counter::poses_dropped), 5000U);
  auto& events = rig.context().render_events.ring();
  ASSERT_NE(events.front(), nullptr);
  EXPECT_EQ(events.front()->kind, EventKind::poses_dropped);
  EXPECT_NE(describe(*events.front()).text.find("event=poses_dropped count=4096"),
            std::string::npos);
  events.pop();
  EXPECT_EQ(events.front(), nullptr) << "once per run";

  // The source counts from nothing after it was reset.
  rig.script.dropped_poses = 0;
  rig.command(CommandKind::reset);
  rig.send(1, 1);
  rig.settle();
  EXPECT_EQ(rig.frames.back().header.flags & protocol::kFlagDegraded, 0U);
  rig.script.dropped_poses = 10;
  rig.send(2, 2);
  rig.settle();
  EXPECT_EQ(rig.count(Counter::poses_dropped), 5010U);
}

TEST(Conductor, SaysWhichFramesHaveEntitiesOfAnOlderOne) {
  for (const auto mode : {config::PacingMode::ig_clock, config::PacingMode::host_step}) {
    for (const int moving : {60, 100}) {  // by each of two host frames
      SCOPED_TRACE(moving);
      config::PacingConfig pacing;
      pacing.mode = mode;
      pacing.rate_hz = 100.0;
      pacing.horizon_ns = 1000 * test::kMs;
      test::ConductorRig rig(pacing);
      rig.settle();
      const bool stepped = mode == config::PacingMode::host_step;
      if (stepped) {
        rig.command(CommandKind::stop);  // what comes piles up
      }
      for (std::uint64_t half = 0; half < 2; ++half) {
        rig.with([&](protocol::HostFrameData& frame) {
          frame.entity_count = static_cast<std::uint32_t>(moving);
          for (std::uint32_t i = 0; i < frame.entity_count; ++i) {
            protocol::EntityStateData& state = frame.entities[i];
            state = {};
            state.entity_id = 1 + static_cast<std::uint32_t>(half) * 100 + i;
            state.on = state.has_pose = true;
          }
        });
        rig.send(1 + half, 0);
        rig.settle();
      }
      if (stepped) {
        rig.command(CommandKind::step);
        rig.settle();
      } else {
        rig.next_slot();
      }
      ASSERT_FALSE(rig.frames.empty());
      const bool behind = moving == 100;
      const auto& header = rig.frames.back().header;
      EXPECT_EQ((header.flags & protocol::kFlagDegraded) != 0, behind);
      EXPECT_EQ(std::isnan(header.estimated_error_k), behind);
      EXPECT_EQ(rig.count(Counter::frames_entities_behind), behind ? 1U : 0U);
      if (stepped) continue;
      // Entities that stand still do not block: the rest comes with the next frame, and then no
      // entity is behind, however many there are.
      for (int slot = 0; slot < 5; ++slot) {
        rig.next_slot();
        EXPECT_EQ(rig.frames.back().header.flags & protocol::kFlagDegraded, 0U) << slot;
      }
      EXPECT_EQ(rig.count(Counter::frames_entities_behind), behind ? 1U : 0U);
    }
  }
}

TEST(Conductor, OfMoreEntitiesThanAFrameTakesThoseThatStandAreToldNowAndThen) {
  config::PacingConfig pacing;
  pacing.mode = config::PacingMode::ig_clock;
  pacing.rate_hz = 100.0;
  pacing.horizon_ns = 1000 * test::kMs;
  test::ConductorRig rig(pacing);
  rig.settle();
  constexpr std::uint32_t kStanding = 500;  // ids of two that stand askew
  constexpr std::uint64_t kSlots = 100;
  for (std::uint64_t slot = 1; slot <= kSlots; ++slot) {
    const bool placing = slot == 1;
    rig.with([&](protocol::HostFrameData& frame) {
      frame.entity_count = placing ? 2 : protocol::kMaxEntitiesPerFrame;
      for (std::uint32_t i = 0; i < frame.entity_count; ++i) {
        protocol::EntityStateData& state = frame.entities[i];
        state = {};
        state.entity_id = placing ? kStanding + i : 1 + i;
        state.on = state.has_pose = true;
        state.pose.position_world_m = {placing ? 3.0 : 0.1 * static_cast<double>(slot), i, 0.0};
        state.pose.world_from_body =
            physics::world_from_body_heading_pitch_roll(0.65 + 0.1 * i, 0.02, 0.01);
      }
    });
    rig.send(slot, static_cast<std::int64_t>(slot) * 10 * test::kMs);
    rig.settle();
    rig.next_slot();
  }
  std::map<std::uint32_t, std::vector<std::int64_t>> told_ns;
  for (const auto& [sim_time_ns, updates] : rig.script.entities) {
    for (const auto& update : updates) told_ns[update.entity_id].push_back(sim_time_ns);
  }
  ASSERT_EQ(told_ns.size(), 2U + protocol::kMaxEntitiesPerFrame);
  for (const auto& [id, times] : told_ns) {
    const bool stands = id >= kStanding;
    const std::int64_t longest_ns = (stands ? 270 : 30) * test::kMs;
    for (std::size_t i = 1; i < times.size(); ++i) {
      EXPECT_LE(times[i] - times[i - 1], longest_ns) << id;
    }
    EXPECT_LE(rig.script.entities.back().first - times.back(), longest_ns) << id;
  }
  // Each of those takes the place of an entity that moved, which is then behind for a frame.
  EXPECT_GE(rig.count(Counter::frames_entities_behind), 3U);
  EXPECT_LE(rig.count(Counter::frames_entities_behind), 10U);
}

TEST(Conductor, WhatMovesIsInEveryFrameHoweverManyStand) {
  struct Case {
    double rate_hz;
    std::uint32_t moving;
    std::uint32_t standing;
  };
  for (const Case& test : {Case{2.0, 1, 200}, Case{25.0, 60, 700}}) {
    SCOPED_TRACE(test.standing);
    config::PacingConfig pacing;
    pacing.mode = config::PacingMode::ig_clock;
    pacing.rate_hz = test.rate_hz;
    pacing.horizon_ns = 10'000 * test::kMs;
    test::ConductorRig rig(pacing);
    rig.settle();
    std::uint64_t number = 0;
    const auto slot_ns = static_cast<std::int64_t>(1e9 / test.rate_hz);
    const auto say = [&](std::int64_t sim_time_ns, std::uint32_t first_id, std::uint32_t count,
                         double x_m) {
      rig.with([&](protocol::HostFrameData& frame) {
        frame.entity_count = count;
        for (std::uint32_t i = 0; i < count; ++i) {
          protocol::EntityStateData& state = frame.entities[i];
          state = {};
          state.entity_id = first_id + i;
          state.on = state.has_pose = true;
          state.pose.position_world_m = {x_m, i, 0.0};
        }
      });
      rig.send(++number, sim_time_ns);
      rig.settle();
    };
    constexpr std::uint32_t kStanding = 1000;
    for (std::uint32_t first = 0; first < test.standing; first += 100) {
      say(0, kStanding + first, 100, 3.0);
    }
    constexpr int kFirst = 10;
    for (int slot = 0; slot < kFirst; ++slot) rig.next_slot();  // all are told where they stand
    const std::uint64_t behind = rig.count(Counter::frames_entities_behind);
    const std::size_t before = rig.script.entities.size();
    constexpr int kSlots = 30;
    for (int slot = 1; slot <= kSlots; ++slot) {
      say((kFirst + slot) * slot_ns, 1, test.moving, slot);
      rig.next_slot();
    }
    EXPECT_EQ(rig.count(Counter::frames_entities_behind), behind);
    ASSERT_EQ(rig.script.entities.size(), before + kSlots);
    std::map<std::uint32_t, int> told;
    for (std::size_t i = before; i < rig.script.entities.size(); ++i) {
      const auto& updates = rig.script.entities[i].second;
      const auto moving = std::ranges::count_if(
          updates, [](const auto& update) { return update.entity_id < kStanding; });
      EXPECT_EQ(moving, test.moving) << i - before;
      for (const auto& update : updates) ++told[update.entity_id];
    }
    EXPECT_EQ(told.size(), test.moving + test.standing) << "the others take turns";
  }
}

}  // namespace
}  // namespace emit::server
