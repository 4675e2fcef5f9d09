// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include "agents/conductor/conductor.hpp"
#include "agents/render/render_agent.hpp"
#include "support/fake_clock.hpp"
#include "support/scripted_source.hpp"
#include "support/times.hpp"

namespace emit::test {

/// Source of the triggers that the test hands out.
class FakeTriggers final : public server::TriggerInput {
 public:
  std::optional<server::ReceivedTrigger> next() noexcept override {
    if (waiting.empty()) return std::nullopt;
    const server::ReceivedTrigger first = waiting.front();
    waiting.pop_front();
    return first;
  }
  std::deque<server::ReceivedTrigger> waiting;
};

inline constexpr double kFovRad = 0.4;
inline constexpr double kFovMinRad = 0.1;

/// Conductor and render agent on a fake clock; the test plays receiver and sender.
class ConductorRig {
 public:
  explicit ConductorRig(config::PacingConfig pacing = {},
                        std::optional<scene::ScenarioDesc> scenario = std::nullopt,
                        bool canned = false, const server::MotionPlan* motion = nullptr,
                        std::int64_t first_time_ns = 0, bool gateway = false)
      : scenario_(std::move(scenario)),
        tracks_(scenario_),
        context_(clock, 1u << 20, 4),
        render_(context_,
                [this] {
                  return physics::Result<std::unique_ptr<server::FrameSource>>(
                      std::make_unique<ScriptedSource>(script, 8, 4, 7));
                }),
        conductor_(context_, tracks_, options(pacing, canned, motion, first_time_ns, gateway),
                   pacing.mode == config::PacingMode::trigger ? &triggers_ : nullptr) {
    EXPECT_TRUE(render_.on_start());
    auto table = *server::make_channels(std::nullopt, *render_.source_info());
    context_.channels = std::move(table.channels);
    context_.pictures = std::move(table.pictures);
    context_.cameras = std::move(table.cameras);
    context_.cameras.front().along_projector = motion != nullptr && motion->projects;
    EXPECT_TRUE(conductor_.on_start());
  }
  ~ConductorRig() { render_.on_stop(); }

  /// Turns both agents until neither has anything left to do at this instant.
  void settle() {
    for (int turn = 0; turn < 1000; ++turn) {
      int work = conductor_.do_work(clock.tai_ns());
      work += render_.do_work(clock.tai_ns());
      while (const server::PublishFrame* frame = context_.published.front()) {
        frames.push_back(*frame);
        if (!frame->repeat) {
          frame->image.release();
        }
        context_.published.pop();
        ++work;
      }
      while (const server::StatusReply* reply = context_.replies.front()) {
        replies.push_back(*reply);
        context_.replies.pop();
      }
      if (work == 0) {
        return;
      }
    }
    FAIL() << "never idle";
  }

  /// Does the same as settle(), with a render thread that does not come to its turn.
  void settle_without_render() {
    while (conductor_.do_work(clock.tai_ns()) > 0) {
    }
  }

  /// Does the same as settle(), with a sender that does not come to its turn.
  void settle_without_sender() {
    while (conductor_.do_work(clock.tai_ns()) + render_.do_work(clock.tai_ns()) > 0) {
    }
  }

  server::HostInput& next_input() { return context_.host_inputs.claim_reserved(); }
  void send(std::uint64_t number, std::int64_t sim_ns, double x_m = 0.0, std::uint64_t run = 1) {
    server::HostInput& input = next_input();
    input = {};
    input.origin.kind = server::Origin::Kind::udp;
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
  void command(server::CommandKind kind) {
    server::HostInput& input = next_input();
    input = {};
    input.kind = server::HostInput::Kind::command;
    input.origin.kind = server::Origin::Kind::tcp;
    input.command = kind;
    context_.host_inputs.commit();
  }
  /// Sends a host frame of the gateway.
  void send_from_gateway(std::uint64_t number, std::int64_t sim_ns, std::uint64_t run = 1) {
    server::HostInput& input = context_.gateway_inputs.claim_reserved();
    input = {};
    input.origin.kind = server::Origin::Kind::gateway;
    input.frame.frame_number = number;
    input.frame.sim_time_ns = sim_ns;
    input.frame.run_id = run;
    input.frame.received_ns = clock.tai_ns();
    context_.gateway_inputs.commit();
  }
  ConductorRig& with(std::function<void(protocol::HostFrameData&)> edit) {
    edit_ = std::move(edit);
    return *this;
  }
  /// Sends a trigger that arrives now.
  void trigger(std::uint64_t number, std::uint64_t run = 1, std::int64_t edge_ns = 0) {
    triggers_.waiting.push_back({{run, number, edge_ns}, clock.tai_ns()});
  }
  void pass(std::int64_t ns) {
    clock.set(clock.tai_ns() + ns);
    settle();
  }
  /// Ends the slot under way.
  void next_slot() {
    clock.set(conductor_.wake_at_ns());
    settle();
  }
  std::uint64_t count(server::Counter id) { return context_.counters.get(id); }
  server::Context& context() { return context_; }
  server::Conductor& conductor() { return conductor_; }
  server::RenderAgent& render() { return render_; }

  FakeClock clock;
  SourceScript script;
  std::vector<server::PublishFrame> frames;
  std::vector<server::StatusReply> replies;

 private:
  static server::Conductor::Options options(config::PacingConfig pacing, bool canned,
                                            const server::MotionPlan* motion,
                                            std::int64_t first_time_ns, bool gateway) {
    server::Conductor::Options out;
    out.gateway = gateway;
    out.first_time_ns = first_time_ns;
    out.motion = motion;
    out.canned = canned;
    out.pacing = pacing;
    out.fov_h_rad = kFovRad;
    out.fov_h_min_rad = kFovMinRad;
    return out;
  }

  std::optional<scene::ScenarioDesc> scenario_;
  server::ScenarioTracks tracks_;
  server::Context context_;
  FakeTriggers triggers_;
  server::RenderAgent render_;
  server::Conductor conductor_;
  std::function<void(protocol::HostFrameData&)> edit_;
};

/// Scenario tracks with one entity, placed at (5, 6, 0).
inline scene::ScenarioDesc scenario_with_entity(std::uint32_t id) {
  scene::ScenarioDesc scenario;
  scene::ObjectDesc object;
  object.entity_id = id;
  object.instances.resize(1);
  object.instances[0].position_world_m = {5.0, 6.0, 0.0};
  scenario.objects.push_back(object);
  return scenario;
}

}  // namespace emit::test
