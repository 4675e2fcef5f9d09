// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <memory>
#include <optional>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/frame_source.hpp"
#include "motion/shift_finder.hpp"
#include "pacing/quality_policy.hpp"

namespace emit::server {

/// Returns true where a frame behind a jump of simulation time takes so long to submit that the
/// surface is warming up again. Without a warm-up submit() takes milliseconds.
/// @param submitting_ns  time that submit() has taken, so far or in all
[[nodiscard]] constexpr bool warms_up_again(std::int64_t submitting_ns) noexcept {
  constexpr std::int64_t kLongestSubmitNs = 100'000'000;
  return submitting_ns > kLongestSubmitNs;
}

/// Owns the frame source from its making to its end, carries out render jobs in order and hands
/// finished images to the conductor. A frame is always collected before a later one.
class RenderAgent final : public Agent {
 public:
  RenderAgent(Context& context, FrameSourceFactory factory)
      : Agent(context.bells.render), context_(context), factory_(std::move(factory)) {}
  ~RenderAgent() override;

  [[nodiscard]] std::string_view name() const noexcept override { return "render"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  void on_stop() noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return wake_at_ns_; }

  /// Returns the source's description, or the reason why there is none. Call it after on_start, and
  /// not while the agent runs.
  [[nodiscard]] const physics::Result<SourceInfo>& source_info() const noexcept { return info_; }
  /// Lets pictures shift with the axes of a motion simulator. The plan outlives the agent. Call it
  /// before frames are asked for.
  void shift_by(const MotionPlan& plan) noexcept { shifts_.emplace(plan); }

 private:
  struct InFlight {
    /// Images by camera; those with a slot have `shown`.
    std::array<CameraImage, kMaxCameras> cameras;
    std::size_t shots = 0;      ///< images that were submitted
    std::size_t collected = 0;  ///< of them
    std::uint8_t quality_level = 0;
    ShownAttitude attitude;
    std::int64_t display_ns = 0;
    // The same for the images that look ahead.
    ShownAttitude ahead_attitude;
    std::int64_t ahead_display_ns = 0;
    std::int64_t render_start_ns = 0;
    double expected_ms = 0.0;   ///< time of its quality level, by the ladder
    std::int64_t begun_ns = 0;  ///< monotonic; render_start_ns is TAI
    ChannelSet channels = 0;
    std::uint64_t rendered_number = 0;
    bool warmed_up = false;  ///< the surface warmed up again in its submit()
  };
  /// Number of frames in flight. With more than one, upload of the next overlaps with read-back of
  /// the last.
  static constexpr std::size_t kDepth = 2;
  /// Frames in a row with an error of the driver, and how long one may be in work, before the
  /// device counts as lost. A software renderer may take seconds for a frame.
  static constexpr std::uint32_t kMaxFailures = 30;
  static constexpr std::int64_t kLongestFrameNs = 60'000'000'000;

  bool take_job() noexcept;
  /// Submits the shots of the job in front that are not submitted yet. Returns false where a slot
  /// is lacking.
  [[nodiscard]] bool submit_shots(RenderJob& job) noexcept;
  /// Hands an image to the source; no slot: every slot is in use. `warmed_up` becomes true where
  /// the surface warmed up again, which is then counted and logged.
  [[nodiscard]] std::optional<renderer::SlotIndex> submit(const renderer::FrameRequest& request,
                                                          bool& warmed_up) noexcept;
  bool finish_oldest() noexcept;
  /// Begins the report of a frame whose first image is in `slot`.
  void begin_done(const InFlight& frame, renderer::SlotIndex slot, RenderDone& done) noexcept;
  /// Takes the pixels of one camera.
  void finish_shot(InFlight& frame, std::size_t camera, RenderDone& done) noexcept;
  /// Takes what the axes of a motion simulator measured.
  void take_feedback() noexcept;
  /// Finds the shifts of the frame by the newest measurements, where pictures shift.
  void find_shifts(const InFlight& frame, RenderDone& done) noexcept;
  /// Finds one shift, and counts where it is not known. Returns false then.
  [[nodiscard]] bool find_shift(const ShownAttitude& attitude, std::int64_t display_ns,
                                glm::vec2& shift_px) noexcept;
  /// Takes the pictures of one camera that image.channels show, and their checksums.
  void take_pictures(const InFlight& frame, std::size_t camera, const renderer::FrameView& view,
                     renderer::SlotIndex slot, Image& image) noexcept;
  /// Chooses the quality level of a frame of so many images, by the first one.
  [[nodiscard]] std::uint8_t choose_quality_level(const RenderJob& job,
                                                  const renderer::FrameRequest& first,
                                                  std::int64_t now_ns, std::size_t shots) noexcept;
  void apply_weather(const RenderJob& job) noexcept;
  void apply_parts(const RenderJob& job) noexcept;
  void note_dropped_poses(std::uint64_t in_run) noexcept;
  /// Counts the limits that the heat of a picture has passed, and tells each once in a run.
  void note_heat_limits(const renderer::HeatLimits& limits) noexcept;
  void note_coarse(const renderer::CoarseReasons& reasons) noexcept;
  void note_device(const renderer::FrameView& view) noexcept;
  /// Sets Context::device_lost, upon which the daemon ends. No frame comes any more.
  void lose_device(std::string_view why) noexcept;

  Context& context_;
  FrameSourceFactory factory_;
  std::unique_ptr<FrameSource> source_;
  physics::Result<SourceInfo> info_ =
      physics::make_error(physics::ErrorCode::internal, "the frame source was not started");
  std::array<InFlight, kDepth> in_flight_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  QualityPolicy quality_;
  std::optional<ShiftFinder> shifts_;  // empty: no picture shifts
  std::int64_t wake_at_ns_ = kNeverNs;
  std::uint32_t failures_ = 0;  // of the device, in a row
  bool lost_ = false;
  bool starved_ = false;
  /// Thermal clock of the frame submitted last; a reset of the run does not move the surface.
  std::optional<std::int64_t> last_thermal_ns_;
  bool weather_lost_ = false;            // said so for this run
  std::uint64_t dropped_poses_ = 0;      // counted in this run
  renderer::HeatLimits heat_limits_;     // told in this run
  renderer::CoarseReasons coarse_told_;  // likewise
  bool job_prepared_ = false;  // entities of the job in front are applied; only submit is missing
};

}  // namespace emit::server
