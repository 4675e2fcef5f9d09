// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>

#include "agents/conductor/conductor.hpp"
#include "agents/context.hpp"
#include "agents/gateway/gateway_agent.hpp"
#include "agents/motion/motion_agent.hpp"
#include "agents/receiver/receiver.hpp"
#include "agents/recorder/recorder.hpp"
#include "agents/render/render_agent.hpp"
#include "agents/runner.hpp"
#include "agents/sender/sender.hpp"
#include "agents/sender/shm_client.hpp"
#include "app/process_names.hpp"
#include "console/console_tap.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "telemetry/duty_cycle.hpp"

namespace emit::server {

/// The agents of the daemon with their runners: five, one more with a motion simulator and one more
/// with a gateway, and the orders in which they are started, stepped and stopped. Setup calls the
/// functions from open_receiver() to make_runners() in their order. Thread: main.
class AgentSet {
 public:
  /// The arguments outlive the set. `stepped`: no threads, the caller runs the agents with step().
  AgentSet(Context& context, const config::DaemonConfig& config,
           const std::optional<scene::ScenarioDesc>& scenario, const ScenarioTracks& tracks,
           bool stepped)
      : context_(context),
        config_(config),
        scenario_(scenario),
        tracks_(tracks),
        stepped_(stepped) {}
  AgentSet(const AgentSet&) = delete;
  AgentSet& operator=(const AgentSet&) = delete;

  /// Makes the receiver and opens its ports. Errors: config, io; they name the file.
  [[nodiscard]] physics::Result<void> open_receiver();
  /// Returns the factory of the source that the configuration names. `progress` is called on the
  /// render agent's thread.
  [[nodiscard]] FrameSourceFactory configured_source(renderer::WarmUpProgress progress) const;
  /// Makes the render agent and waits until its source is made and warmed up.
  /// Errors: those of the factory, internal (no thread).
  [[nodiscard]] physics::Result<void> start_render(FrameSourceFactory factory);
  /// Makes the recorder and opens the journal. Errors: config (the disk leaves no room), io (the
  /// journal or a file of the scenario), parse (a glTF file).
  /// @pre context.channels is filled
  [[nodiscard]] physics::Result<Recorder::Opened> make_recorder(const ProcessNames& names);
  /// Makes the sender, and the shared memory where stream.shm asks for it. Errors: io.
  /// @pre start_render() succeeded
  [[nodiscard]] physics::Result<void> make_sender();
  /// Makes the motion agent where the configuration has a motion simulator. Errors: config (also
  /// when pictures shift without one), io (the controller's address).
  /// @pre context.channels is filled
  [[nodiscard]] physics::Result<void> make_motion();
  /// Makes the gateway agent where the configuration has a host that needs one. Errors: config, io
  /// (an address, a glTF file), internal (Embree).
  [[nodiscard]] physics::Result<void> make_gateway();
  /// `triggers` outlives the set; pacing mode trigger needs it, the other modes take null.
  /// @pre start_render() succeeded
  void make_conductor(TriggerInput* triggers);
  /// Makes the runners of all agents but render; in stepped mode it starts them too. Errors: io.
  /// @pre every agent was made
  [[nodiscard]] physics::Result<void> make_runners();

  /// Starts the threads of all agents but render.
  /// @return the name of the agent that did not start; empty: all run
  /// @pre make_runners() succeeded
  [[nodiscard]] std::string_view start_serving();
  /// Runs every agent once, in a fixed order. Returns the work done (0 = idle).
  /// @pre is_made()
  int step();
  /// Takes no further input and calls `step` until the conductor has finished its frames.
  /// @pre is_made()
  void drain_stepped(const std::function<int()>& step);
  /// Stops the agents that were made, render last. Idempotent.
  void stop();
  /// Stops all agents but render, whose thread may hang in the driver. Idempotent.
  void stop_without_render();

  /// Returns true once every agent has a runner.
  [[nodiscard]] bool is_made() const noexcept { return conductor_runner_ != nullptr; }
  /// Returns the duty cycles of the agents; empty before make_runners().
  [[nodiscard]] const NamedDutyCycles& duty_cycles() const noexcept { return duty_cycles_; }
  /// @pre start_render() succeeded
  [[nodiscard]] const SourceInfo& source() const;

  // The agents. @pre: the agent was made.
  [[nodiscard]] Receiver& receiver() const;
  [[nodiscard]] Recorder& recorder() const;
  [[nodiscard]] Sender& sender() const;
  [[nodiscard]] Conductor& conductor() const;
  /// Returns where the console takes its images from; null: there is no console.
  [[nodiscard]] ConsoleTap* console_tap() const noexcept { return console_tap_.get(); }
  /// Returns where the console gets the journal of the run from; null: there is no console.
  [[nodiscard]] JournalTap* journal_tap() const noexcept { return journal_tap_.get(); }
  /// Returns the gateway agent; null: there is none.
  [[nodiscard]] const GatewayAgent* gateway() const noexcept { return gateway_.get(); }

 private:
  /// Refuses channels whose pictures shift, where there is no motion simulator.
  [[nodiscard]] physics::Result<void> check_no_shift() const;
  // A runner is null before it is made, and those of motion and gateway without one.

  /// Returns the runners that start after the render agent's, in the order of their start.
  [[nodiscard]] std::array<AgentRunner*, 6> serving_order() const noexcept {
    return {recorder_runner_.get(),  sender_runner_.get(),   motion_runner_.get(),
            conductor_runner_.get(), receiver_runner_.get(), gateway_runner_.get()};
  }
  /// Returns the runners in the order of a frame's way; the conductor has two turns, one before and
  /// one after rendering.
  [[nodiscard]] std::array<AgentRunner*, 8> step_order() const noexcept {
    return {receiver_runner_.get(),  gateway_runner_.get(), motion_runner_.get(),
            conductor_runner_.get(), render_runner_.get(),  conductor_runner_.get(),
            sender_runner_.get(),    recorder_runner_.get()};
  }
  /// Returns the runners in the order in which /metrics and the log name them.
  [[nodiscard]] std::array<AgentRunner*, 7> label_order() const noexcept {
    return {receiver_runner_.get(), conductor_runner_.get(), render_runner_.get(),
            sender_runner_.get(),   recorder_runner_.get(),  motion_runner_.get(),
            gateway_runner_.get()};
  }
  /// Returns the runners in the order of their stop, without render. It is against the flow of what
  /// is lent: slots go back to the source before it ends, and descriptors to the receiver before it
  /// closes them.
  [[nodiscard]] std::array<AgentRunner*, 6> stop_order() const noexcept {
    return {conductor_runner_.get(), motion_runner_.get(),   sender_runner_.get(),
            recorder_runner_.get(),  receiver_runner_.get(), gateway_runner_.get()};
  }
  void plan_realtime(AgentRunner& runner) const;

  Context& context_;
  const config::DaemonConfig& config_;
  const std::optional<scene::ScenarioDesc>& scenario_;
  const ScenarioTracks& tracks_;
  bool stepped_;
  // Runners are destroyed before the agents that they run.
  std::unique_ptr<Receiver> receiver_;
  std::unique_ptr<RenderAgent> render_;
  std::unique_ptr<JournalTap> journal_tap_;
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<ShmClient> shm_;
  std::unique_ptr<ConsoleTap> console_tap_;
  std::unique_ptr<Sender> sender_;
  std::optional<MotionPlan> motion_plan_;
  std::unique_ptr<MotionAgent> motion_;
  std::unique_ptr<GatewayAgent> gateway_;
  std::unique_ptr<Conductor> conductor_;
  std::unique_ptr<AgentRunner> receiver_runner_;
  std::unique_ptr<AgentRunner> render_runner_;
  std::unique_ptr<AgentRunner> recorder_runner_;
  std::unique_ptr<AgentRunner> sender_runner_;
  std::unique_ptr<AgentRunner> motion_runner_;
  std::unique_ptr<AgentRunner> gateway_runner_;
  std::unique_ptr<AgentRunner> conductor_runner_;
  NamedDutyCycles duty_cycles_;
};

}  // namespace emit::server
