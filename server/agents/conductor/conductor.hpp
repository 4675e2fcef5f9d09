// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <optional>
#include <vector>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/journal_ring.hpp"
#include "emit/config/daemon_config.hpp"
#include "net/trigger_port.hpp"
#include "pacing/deadline_policy.hpp"
#include "pacing/ig_clock.hpp"
#include "pacing/input_gate.hpp"
#include "pacing/pose_track.hpp"
#include "pacing/prediction_check.hpp"
#include "pacing/run_control.hpp"
#include "pacing/scenario_track.hpp"
#include "pacing/trigger_gate.hpp"

namespace emit::server {

/// Turns host inputs into render jobs and images into frames: pacing, control, deadlines, journal.
/// What it decides follows from inputs and clock alone.
class Conductor final : public Agent {
 public:
  /// `canned`: frames carry kFlagCanned.
  struct Options {
    config::PacingConfig pacing;
    bool canned = false;
  };
  /// `triggers`: of pacing mode trigger, which needs them; read on the agent's thread.
  Conductor(Context& context, const ScenarioTracks& scenario, const Options& options,
            TriggerInput* triggers = nullptr);

  [[nodiscard]] std::string_view name() const noexcept override { return "conductor"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override;
  [[nodiscard]] int wait_fd() const noexcept override {
    // Nobody reads it while draining, and what waits there must not wake the agent over and over.
    return triggers_ != nullptr && !draining_.load(std::memory_order_relaxed) ? triggers_->fd()
                                                                              : -1;
  }

  /// Any thread: takes no further input, finishes what is in work; then drained() is true.
  void drain() noexcept { draining_.store(true, std::memory_order_release); }
  [[nodiscard]] bool drained() const noexcept { return drained_.load(std::memory_order_acquire); }

 private:
  /// What was decided when a frame was issued, until its image comes back.
  struct Issued {
    protocol::FrameHeader header;
    std::int64_t thermal_time_ns = 0;
    bool entities_behind = false;  ///< there were more than one frame takes
    std::uint32_t entity_count = 0;
    std::array<renderer::EntityUpdate, protocol::kMaxEntitiesPerFrame> entities;
  };
  struct Entity {
    std::uint32_t id = 0;
    PoseTrack track;
    bool on = true;
    bool touched = false;           // listed in touched_
    bool teleport_pending = false;  // jumps, these two and any between, that no update has shown
    std::int64_t first_teleport_ns = 0;
    std::int64_t last_teleport_ns = 0;
    // Of slotted frames:
    struct Shown {
      physics::Pose pose;
      std::int64_t sim_time_ns = 0;
      bool on = true;
    };
    std::optional<Shown> shown;  // by its last update
    PoseSample placed;           // in the frame that is made up
    bool moved = false;          // there, since `shown`
    bool told = false;           // of that frame
  };
  static constexpr std::size_t kMaxIssued = 8;
  static constexpr std::size_t kMaxTracked = 1024;

  [[nodiscard]] bool ig_clock() const noexcept {
    return options_.pacing.mode == config::PacingMode::ig_clock;
  }
  [[nodiscard]] bool triggered() const noexcept { return triggers_ != nullptr; }
  /// Frames belong to slots, not to poses.
  [[nodiscard]] bool slotted() const noexcept { return ig_clock() || triggered(); }

  // Inputs (conductor_input.cpp).
  int take_inputs(std::int64_t now_ns) noexcept;
  bool take_frame(HostInput& input, std::int64_t now_ns) noexcept;
  bool take_command(const HostInput& input, std::int64_t now_ns) noexcept;
  void remember(const protocol::HostFrameData& frame) noexcept;
  void remember_entity(const protocol::EntityStateData& state, std::int64_t sim_time_ns) noexcept;
  void remember_weather(const protocol::EnvironmentData& environment,
                        std::int64_t sim_time_ns) noexcept;
  void drop_unknown_entities(HostInput& input) noexcept;
  void refuse(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
              std::uint64_t detail = 0) noexcept;
  void reply(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
             std::uint64_t count, std::uint64_t detail) noexcept;
  [[nodiscard]] Entity* entity(std::uint32_t id) noexcept;
  void journal_host_frame(const protocol::HostFrameData& frame, std::int64_t now_ns) noexcept;
  void count_lost_line() noexcept;

  // Frames (conductor.cpp).
  void start_run(std::int64_t now_ns) noexcept;
  /// Back to the start snapshot. False: frames are still in work, ask again.
  [[nodiscard]] bool reset_run(std::int64_t now_ns) noexcept;
  /// `received_ns`: when what asked for the frame came; its deadline counts from there.
  void issue_host_step(bool is_step, std::int64_t received_ns) noexcept;
  void issue_slotted() noexcept;
  void issue(RenderJob& job, Issued& issued, bool is_step) noexcept;
  [[nodiscard]] Issued& next_issued() noexcept;
  /// `base_ns`: time stamp of the received pose that `pose` starts from (PoseSample).
  void add_update(RenderJob& job, Entity& entity, const physics::Pose& pose,
                  std::int64_t base_ns) noexcept;
  /// Of all entities, where they are at that instant. False: not all that moved had room.
  [[nodiscard]] bool add_updates(RenderJob& job, std::int64_t shown_ns) noexcept;
  void begin_slot() noexcept;
  [[nodiscard]] std::int64_t slot_begin_ns() const noexcept {
    return triggered() ? trigger_.begin_ns() : clock_.begin_ns();
  }
  /// When the slot's frame is due.
  [[nodiscard]] std::int64_t slot_deadline_ns() const noexcept {
    return triggered() ? trigger_.end_ns() : clock_.end_ns();
  }
  /// When the slot under way is over as far as is known now; kNeverNs without one.
  [[nodiscard]] std::int64_t slot_end_ns() const noexcept;
  [[nodiscard]] bool can_issue() noexcept;
  int take_images_and_slots(std::int64_t now_ns) noexcept;
  bool end_slot(std::int64_t now_ns) noexcept;
  [[nodiscard]] PublishFrame* room_to_publish() noexcept;
  bool publish_image(const RenderDone& done, std::int64_t now_ns) noexcept;
  bool publish_repeat(std::int64_t now_ns) noexcept;
  void journal_frame(const protocol::FrameHeader& header, const Issued* issued,
                     std::int64_t now_ns) noexcept;
  void count_flags(std::uint32_t flags) noexcept;
  void record_times(const protocol::FrameHeader& header) noexcept;

  // Pacing mode trigger (conductor_trigger.cpp).
  void poll_triggers(std::int64_t now_ns) noexcept;
  bool begin_triggered_slot() noexcept;
  void watch_silence(std::int64_t now_ns) noexcept;
  [[nodiscard]] std::int64_t trigger_wake_at_ns() const noexcept;

  Context& context_;
  const ScenarioTracks& scenario_;
  Options options_;
  JournalWriter journal_;

  RunControl control_;
  InputGate gate_;
  IgClock clock_;
  SlotPolicy slots_;
  bool clock_started_ = false;

  TriggerInput* triggers_;
  TriggerGate trigger_;
  std::optional<ReceivedTrigger> pending_trigger_;  // passed the gate, its slot has not begun
  bool trigger_fault_ = false;                      // to be flagged on the next frame issued
  std::int64_t stranger_told_ns_ = 0;
  bool trigger_silent_ = false;

  PoseTrack seeker_;
  PredictionCheck prediction_;
  std::vector<Entity> entities_;  // reserved at start, sorted by id
  bool have_host_frame_ = false;
  std::uint64_t host_frame_number_ = 0;
  std::int64_t host_sim_time_ns_ = 0;
  std::int64_t host_received_ns_ = 0;
  std::int64_t last_sim_time_ns_ = 0;  // of the newest frame issued in this run
  bool issued_any_ = false;
  bool reset_pending_ = false;          // waits for the frames in work
  std::vector<std::uint32_t> touched_;  // host-step: entities to apply with the next frames
  // Slotted: where the next frame goes on, if not all fit.
  std::size_t next_entity_ = 0;
  std::size_t next_standing_ = 0;
  std::array<scene::WeatherSample, kMaxWeatherPerFrame> weather_;  // goes with the next frame
  std::size_t weather_count_ = 0;

  std::uint64_t run_id_ = 0;
  std::uint64_t frame_number_ = 0;   // of the newest frame published
  std::uint64_t render_number_ = 0;  // of the newest frame issued
  std::vector<Issued> issued_;       // ring of kMaxIssued
  std::size_t issued_first_ = 0;
  std::size_t issued_count_ = 0;
  protocol::FrameHeader shown_;  // of the image published last
  std::int64_t shown_thermal_ns_ = 0;
  std::uint32_t shown_crc_ = 0;      // of the first channel that shows it
  std::uint32_t shown_channel_ = 0;  // that channel
  bool journal_lossy_ = false;

  std::atomic<bool> draining_{false};
  std::atomic<bool> drained_{false};
};

}  // namespace emit::server
