// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "agents/conductor/frame_ledger.hpp"
#include "agents/context.hpp"
#include "motion/feedback_track.hpp"
#include "motion/motion_plan.hpp"
#include "motion/shift_finder.hpp"
#include "pacing/scenario_track.hpp"

namespace emit::server {

/// The conductor's side of a motion simulator: it tells the motion agent the poses, turns the
/// camera of projected frames to where the axes will be, and says in every frame what they do.
///
/// Thread: the conductor's. Real time: RT-safe.
class MotionView {
 public:
  /// The arguments outlive the view.
  MotionView(Context& context, const ScenarioTracks& scenario, const MotionPlan& plan)
      : context_(context), scenario_(scenario), plan_(plan) {}

  /// A run begins.
  void start_run() noexcept;
  /// Asks the motion agent to close the interlock, because the host has reset the run.
  void reset() noexcept;
  /// Hands the place of the target to the motion agent, if target rings point to one.
  void take_target(const protocol::HostFrameData& frame) noexcept;
  /// Hands a pose of the host to the motion agent.
  void take_pose(const protocol::HostFrameData& frame) noexcept;
  /// Takes the reports of the motion agent. One that is silent counts as a lack of measurements.
  /// @return the number of reports taken
  int take_reports() noexcept;

  /// Finds the attitudes of a frame that is shown at `display_ns`, wall.
  void place(RenderJob& job, FrameLedger::Issued& issued, std::int64_t display_ns) noexcept;
  /// Finds those of the images that look ahead, with the seeker in `sensor_pose`.
  /// @pre place() has placed the frame
  void place_ahead(RenderJob& job, FrameLedger::Issued& issued, const physics::Pose& sensor_pose,
                   std::int64_t display_ns) noexcept;
  /// Writes state and shift into the header of a finished frame. Where pictures shift, it is the
  /// shift that they were moved by.
  void finish(FrameLedger::Issued& issued, const RenderDone& done) noexcept;
  /// Writes state and shift into the header of the frame that finish() had last, which is shown
  /// again at `display_ns`, and what its images that look ahead say then.
  void finish_repeat(protocol::FrameHeader& header, AheadImage& ahead,
                     std::int64_t display_ns) noexcept;

 private:
  /// A frame whose axes are not measured up to its display yet.
  struct Shown {
    std::int64_t display_ns = 0;
    FrameLedger::Issued::Motion motion;
    glm::dvec2 shift_px{0.0};
  };
  static constexpr std::size_t kKept = 64;

  /// Returns the attitudes of an image with the seeker in `sensor_pose`. `known` becomes false
  /// where no measurement is near.
  [[nodiscard]] ShownAttitude attitude_at(const physics::Pose& sensor_pose, std::int64_t display_ns,
                                          bool& known) const noexcept;
  /// Writes the shift that an image that looks ahead has at its display, or that it is not known.
  void write_ahead(AheadImage& ahead, const FrameLedger::Issued::Motion& motion,
                   const glm::dvec2& shift_px) const noexcept;
  /// Returns the angles at an instant. `known` is false where no measurement is near.
  [[nodiscard]] TableAngles angles_at(std::int64_t time_ns, bool& known) const noexcept;
  /// Returns the shift that brings the image to where the axes are at `display_ns`. It is not a
  /// number where that is not known.
  [[nodiscard]] glm::dvec2 shift_px(const ShownAttitude& attitude,
                                    std::int64_t display_ns) const noexcept;
  void write(protocol::FrameHeader& header, const FrameLedger::Issued::Motion& motion,
             const glm::dvec2& shift_px) noexcept;
  /// Keeps a frame until its axes are measured.
  void keep(const protocol::FrameHeader& header, const FrameLedger::Issued::Motion& motion,
            const glm::dvec2& shift) noexcept;
  void judge_shown() noexcept;
  void push(const MotionInput& input) noexcept;
  /// Hands over what must not get lost: the begin of a run.
  void push_pending() noexcept;

  Context& context_;
  const ScenarioTracks& scenario_;
  const MotionPlan& plan_;
  FeedbackTrack track_;
  protocol::MotionState state_ = protocol::MotionState::waiting;
  std::uint8_t faults_ = protocol::kMotionNoFeedback;
  std::int64_t reported_ns_ = 0;  ///< instant of the latest report, wall
  bool target_moved_ = false;     ///< the host has moved the target in this run
  /// Kind of the message that the motion agent had no room for; pose: there is none.
  MotionInput::Kind pending_ = MotionInput::Kind::pose;
  FrameLedger::Issued::Motion finished_;        ///< of the newest finished frame
  glm::vec2 applied_px_{0.0F};                  ///< shift by which its pictures were moved
  FrameLedger::Issued::Motion finished_ahead_;  ///< of its images that look ahead
  AheadImage ahead_;                            ///< and what they said
  std::int64_t ahead_by_ns_ = 0;  ///< time from its display to theirs; 0: there are none
  std::array<Shown, kKept> shown_;
  std::size_t first_shown_ = 0;
  std::size_t shown_count_ = 0;
  std::optional<double> pointing_error_px_;
};

}  // namespace emit::server
