// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <memory>
#include <optional>

#include "agents/agent.hpp"
#include "agents/conductor/conductor_journal.hpp"
#include "agents/conductor/entity_book.hpp"
#include "agents/conductor/frame_ledger.hpp"
#include "agents/conductor/motion_view.hpp"
#include "agents/conductor/slot_source.hpp"
#include "agents/context.hpp"
#include "emit/config/daemon_config.hpp"
#include "net/trigger_port.hpp"
#include "pacing/deadline_policy.hpp"
#include "pacing/input_gate.hpp"
#include "pacing/pose_track.hpp"
#include "pacing/prediction_check.hpp"
#include "pacing/run_control.hpp"
#include "pacing/scenario_track.hpp"

namespace emit::server {

/// Turns host inputs into render jobs and images into frames: pacing, control, deadlines, journal.
/// Its decisions follow from inputs and clock alone.
class Conductor final : public Agent {
 public:
  struct Options {
    config::PacingConfig pacing;
    bool canned = false;                 ///< frames carry kFlagCanned
    const MotionPlan* motion = nullptr;  ///< the motion simulator, where there is one
    std::int64_t first_time_ns = 0;      ///< simulation time that is shown before the first pose
    double fov_h_rad = 0.0;              ///< field of view at the start of a run; 0: not known
    double fov_h_min_rad = 0.0;          ///< narrowest that a host may set; the widest is fov_h_rad
    bool gateway = false;  ///< host frames come from the gateway, and those of others are refused
  };
  /// @param triggers  where pacing mode trigger reads its triggers, on the agent's thread; that
  ///                  mode needs it
  Conductor(Context& context, const ScenarioTracks& scenario, const Options& options,
            TriggerInput* triggers = nullptr);

  [[nodiscard]] std::string_view name() const noexcept override { return "conductor"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override;
  [[nodiscard]] int wait_fd() const noexcept override;

  /// Takes no further input and finishes what is in work; then drained() is true. Thread: any.
  void drain() noexcept { draining_.store(true, std::memory_order_release); }
  [[nodiscard]] bool drained() const noexcept { return drained_.load(std::memory_order_acquire); }

 private:
  // Inputs (conductor_input.cpp).
  int take_inputs(std::int64_t now_ns) noexcept;
  int take_inputs(SpscRing<HostInput>& inputs, std::int64_t now_ns) noexcept;
  /// Returns false when the input must wait for frames in work. So does take_command().
  bool take_frame(HostInput& input, std::int64_t now_ns) noexcept;
  bool take_command(const HostInput& input, std::int64_t now_ns) noexcept;
  /// Answers a frame that the gate refuses. Returns false when it does not refuse it.
  bool refuse_frame(const HostInput& input, GateVerdict verdict) noexcept;
  /// Answers a frame that makes no image, or makes it.
  void use_pose(const HostInput& input) noexcept;
  void store(const protocol::HostFrameData& frame) noexcept;
  void store_weather(const protocol::EnvironmentData& environment,
                     std::int64_t sim_time_ns) noexcept;
  void drop_unknown_entities(HostInput& input) noexcept;
  /// Leaves out commands to parts that the scenario does not have, and what the next frame has no
  /// room for, and answers them.
  void drop_unknown_parts(HostInput& input) noexcept;
  /// Leaves out a field of view that the sensor cannot have, and answers it.
  void drop_wrong_view(HostInput& input) noexcept;
  void refuse(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
              std::uint64_t detail = 0) noexcept;
  void reply(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
             std::uint64_t count, std::uint64_t detail) noexcept;
  /// Tells the gateway what has become of its host frame.
  void report_input(StatusCode code, std::uint64_t host_frame_number,
                    std::uint64_t detail) noexcept;
  void report(const GatewayReport& report) noexcept;

  // Frames (conductor.cpp).
  [[nodiscard]] bool draining() const noexcept { return draining_.load(std::memory_order_acquire); }
  void start_run(std::int64_t now_ns) noexcept;
  /// Goes back to the start snapshot. Returns false while frames are in work: ask again.
  [[nodiscard]] bool reset_run(std::int64_t now_ns) noexcept;
  /// Issues the frame of the newest pose, in mode host-step.
  /// @param received_ns  arrival of the pose or command that asks for the frame, wall; the deadline
  ///                     counts from there
  void issue_pose(bool is_step, std::int64_t received_ns) noexcept;
  /// Issues the frame of the slot under way.
  void issue_slot() noexcept;
  /// Issues the frame of a slot before any pose came: the scenario's own start.
  void show_start(RenderJob& job, FrameLedger::Issued& issued) const noexcept;
  /// Places sensor and entities where they are at the instant that the slot shows.
  void place_at_slot(RenderJob& job, FrameLedger::Issued& issued) noexcept;
  void issue(RenderJob& job, FrameLedger::Issued& issued, bool is_step) noexcept;
  /// Finds where sensor and entities will be at the later instant that some cameras show, where
  /// there are such (conductor_cameras.cpp).
  void look_ahead(RenderJob& job, FrameLedger::Issued& issued) noexcept;
  /// An instant that cameras show, with the seeker, the projector and the places of entities then.
  struct Moment {
    physics::Pose seeker;
    glm::dmat3 world_from_projector{1.0};
    std::int64_t sim_time_ns = 0;
    EntityBook::Place place = EntityBook::Place::newest;
  };
  /// Places the cameras whose channels show the frame (conductor_cameras.cpp). The pose of the
  /// request, the seeker's, becomes that of the first of them.
  void place_cameras(RenderJob& job, const FrameLedger::Issued& issued) const noexcept;
  /// Returns what carries a camera.
  [[nodiscard]] physics::Pose carrier_of(const Camera& camera, const Moment& moment) const noexcept;
  void begin_slot() noexcept;
  bool end_slot(std::int64_t now_ns) noexcept;
  [[nodiscard]] bool can_issue() noexcept;
  int take_images_and_slots(std::int64_t now_ns) noexcept;
  [[nodiscard]] PublishFrame* room_to_publish() noexcept;
  bool publish_image(const RenderDone& done, std::int64_t now_ns) noexcept;
  bool publish_repeat(std::int64_t now_ns) noexcept;
  void hand_over(const protocol::FrameHeader& header) noexcept;
  void count_flags(std::uint32_t flags) noexcept;
  void record_times(const protocol::FrameHeader& header) noexcept;

  Context& context_;
  const ScenarioTracks& scenario_;
  Options options_;
  ConductorJournal journal_;
  FrameLedger ledger_;
  EntityBook entities_;
  std::optional<MotionView> motion_;
  std::unique_ptr<SlotSource> slots_;  // null: host-step
  SlotPolicy slot_policy_;
  RunControl control_;
  InputGate gate_;
  bool reset_pending_ = false;  // waits for the frames in work

  PoseTrack seeker_;
  PredictionCheck prediction_;
  /// The newest host frame of the run.
  struct NewestInput {
    std::uint64_t number = 0;
    std::int64_t sim_time_ns = 0;
    std::int64_t received_ns = 0;
    bool came = false;  ///< false: the run has had none
  };
  NewestInput input_;
  glm::dquat body_from_detector_{1.0, 0.0, 0.0, 0.0};  // gimbals of the seeker, by the host
  double fov_h_rad_ = 0.0;             // of the frames to come, as the host has set it
  std::int64_t last_sim_time_ns_ = 0;  // of the newest frame issued in this run
  physics::Pose ahead_pose_;           // of the seeker, in the images that look ahead
  bool issued_any_ = false;
  std::array<scene::WeatherSample, kMaxWeatherPerFrame> weather_;  // goes with the next frame
  std::size_t weather_count_ = 0;
  std::array<TimedPart, kMaxPartsPerJob> parts_;  // go with the next frame
  std::size_t part_count_ = 0;

  std::atomic<bool> draining_{false};
  std::atomic<bool> drained_{false};
};

}  // namespace emit::server
