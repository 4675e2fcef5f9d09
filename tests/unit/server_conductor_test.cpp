// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "agents/conductor.hpp"
#include "agents/render_agent.hpp"
#include "support/fake_clock.hpp"
#include "support/scripted_source.hpp"
#include "telemetry/log.hpp"

namespace emit::server {
namespace {

using test::FakeClock;
using test::ScriptedSource;
using test::SourceScript;

constexpr std::int64_t kMs = 1'000'000;

/// Conductor and render agent on a fake clock; the test plays receiver and sender.
class Rig {
 public:
  explicit Rig(config::PacingConfig pacing = {},
               std::optional<scene::ScenarioDesc> scenario = std::nullopt)
      : scenario_(std::move(scenario)),
        tracks_(scenario_),
        context_(clock, 1u << 20, 4),
        render_(context_,
                [this] {
                  return physics::Result<std::unique_ptr<FrameSource>>(
                      std::make_unique<ScriptedSource>(script, 8, 4, 7));
                }),
        conductor_(context_, tracks_, options(pacing)) {
    EXPECT_TRUE(render_.on_start());
    EXPECT_TRUE(conductor_.on_start());
  }
  ~Rig() { render_.on_stop(); }

  /// Until nobody has anything left to do at this instant.
  void settle() {
    for (int turn = 0; turn < 1000; ++turn) {
      int work = conductor_.do_work(clock.tai_ns());
      work += render_.do_work(clock.tai_ns());
      while (const PublishFrame* frame = context_.published.front()) {
        frames.push_back(*frame);
        if (!frame->repeat) {
          frame->image.source->release(frame->image.slot);
        }
        context_.published.pop();
        ++work;
      }
      while (const StatusReply* reply = context_.replies.front()) {
        replies.push_back(*reply);
        context_.replies.pop();
      }
      if (work == 0) {
        return;
      }
    }
    FAIL() << "never idle";
  }

  /// As settle(), with a render thread that does not come to its turn.
  void settle_without_render() {
    while (conductor_.do_work(clock.tai_ns()) > 0) {
    }
  }

  HostInput& next_input() { return context_.host_inputs.claim_reserved(); }
  void send(std::uint64_t number, std::int64_t sim_ns, double x_m = 0.0, std::uint64_t run = 1) {
    HostInput& input = next_input();
    input = {};
    input.origin.kind = Origin::Kind::udp;
    input.frame.frame_number = number;
    input.frame.sim_time_ns = sim_ns;
    input.frame.run_id = run;
    input.frame.received_ns = clock.tai_ns();
    input.frame.seeker.position_world_m.x = x_m;
    if (edit_) {
      edit_(input.frame);
      edit_ = nullptr;
    }
    context_.host_inputs.commit();
  }
  void command(CommandKind kind) {
    HostInput& input = next_input();
    input = {};
    input.kind = HostInput::Kind::command;
    input.origin.kind = Origin::Kind::tcp;
    input.command = kind;
    context_.host_inputs.commit();
  }
  Rig& with(std::function<void(protocol::HostFrameData&)> edit) {
    edit_ = std::move(edit);
    return *this;
  }
  /// Ends the slot under way.
  void next_slot() {
    clock.set(conductor_.wake_at_ns());
    settle();
  }
  std::uint64_t count(Counter id) { return context_.counters.get(id); }
  Context& context() { return context_; }
  Conductor& conductor() { return conductor_; }

  FakeClock clock;
  SourceScript script;
  std::vector<PublishFrame> frames;
  std::vector<StatusReply> replies;

 private:
  static Conductor::Options options(config::PacingConfig pacing) {
    Conductor::Options out;
    out.pacing = pacing;
    return out;
  }

  std::optional<scene::ScenarioDesc> scenario_;
  ScenarioTracks tracks_;
  Context context_;
  RenderAgent render_;
  Conductor conductor_;
  std::function<void(protocol::HostFrameData&)> edit_;
};

config::PacingConfig ig_clock(double rate_hz = 100.0) {
  config::PacingConfig pacing;
  pacing.mode = config::PacingMode::ig_clock;
  pacing.rate_hz = rate_hz;
  return pacing;
}

scene::ScenarioDesc scenario_with_entity(std::uint32_t id) {
  scene::ScenarioDesc scenario;
  scene::ObjectDesc object;
  object.entity_id = id;
  object.instances.resize(1);
  object.instances[0].position_world_m = {5.0, 6.0, 0.0};
  scenario.objects.push_back(object);
  return scenario;
}

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

TEST(IgClockPacing, FlagsATeleportWithTheFirstPoseBehindIt) {
  Rig rig(ig_clock());
  rig.settle();
  const auto entity_at = [](double x_m, bool teleport, std::int64_t early_ns) {
    return [=](protocol::HostFrameData& frame) {
      // A stamp ahead of the slot: its display time lies before this frame's simulation time.
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

}  // namespace
}  // namespace emit::server
