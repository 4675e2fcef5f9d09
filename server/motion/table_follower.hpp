// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/axes.hpp"
#include "emit/protocol/frame_header.hpp"
#include "motion/axis_blend.hpp"
#include "motion/axis_profile.hpp"
#include "motion/feedback_track.hpp"
#include "motion/host_clock.hpp"
#include "motion/motion_table.hpp"
#include "motion/seeker_course.hpp"

namespace emit::server {

/// Makes the commands of a motion simulator from the poses of a host and the measurements of the
/// controller. Between two poses the axes follow the prediction; a new pose takes over without a
/// jump of angle, rate or acceleration. Commands stay within the limits of the axes.
///
/// The axes follow while poses and measurements come. Else they park: when the host is silent, when
/// no measurement comes, when the clocks differ, and when the interlock of the controller is open.
/// They set off softly from where they are; so they do after a jump of simulation time, and when a
/// ring has to turn to another angle for the same attitude.
///
/// Pure: the caller gives all instants. Thread: one owner. Real time: RT-safe after create().
class TableFollower {
 public:
  struct Axis {
    AxisLimits limits;
    double park_rad = 0.0;
  };
  struct Options {
    explicit Options(const MotionTable& motion_table) : table(motion_table) {}

    MotionTable table;
    std::vector<Axis> axes;  ///< three of the unit, then none or two of the target
    std::int64_t period_ns = 1'000'000;
    std::int64_t feedback_timeout_ns = 20'000'000;
    std::int64_t host_timeout_ns = 200'000'000;
    /// Longest prediction beyond the newest pose. The axes come to rest there.
    std::int64_t horizon_ns = 50'000'000;
    std::uint32_t controller_timeout_ms = 100;  ///< after which the controller parks by itself
    double soft_frac = 0.2;  ///< share of rate and acceleration with which the axes set off
  };
  /// State of the axes, and the reasons why they may not show what a frame assumes.
  struct Status {
    protocol::MotionState state = protocol::MotionState::waiting;
    /// protocol::MotionFaults
    std::uint8_t faults = protocol::kMotionNoFeedback | protocol::kMotionNoHost;
  };

  /// Errors: invalid_argument (not three or five axes, a period that is not positive, limits that
  /// AxisProfile refuses, or a park position outside of the travel).
  [[nodiscard]] static physics::Result<TableFollower> create(const Options& options);

  /// Forgets the poses. The axes park until the next one.
  void forget() noexcept;
  /// Forgets the poses, and switches the motors off for a tenth of a second, which closes an
  /// interlock that nothing holds open.
  void reset(std::int64_t now_ns) noexcept;
  /// Takes a pose that arrived at `received_ns`. Returns false if simulation time has jumped
  /// against time.
  bool take(const SeekerPose& pose, std::int64_t received_ns) noexcept;
  /// Takes a place of the target.
  void take(const TimedPoint& target) noexcept {
    incoming_.push_target(target);
    incoming_is_new_ = true;
  }
  /// Takes what the controller reports. Returns the measurement; nothing if it has another number
  /// of axes or is not newer than the latest one.
  std::optional<AxisFeedback> take(const protocol::AxesMonitor& monitor,
                                   std::int64_t now_ns) noexcept;

  /// Returns the command of this instant, to be met one period later.
  const protocol::AxesCommand& step(std::int64_t now_ns) noexcept;

  [[nodiscard]] const Status& status() const noexcept { return status_; }
  /// Returns the largest difference between the latest measurement and what was commanded for its
  /// instant, rad. It is 0 unless the axes follow.
  [[nodiscard]] double error_rad() const noexcept { return error_rad_; }
  /// Returns what was commanded for the instant of the latest measurement, rad, by axis. It is
  /// empty unless the latest command was to follow.
  [[nodiscard]] std::span<const double> asked_rad() const noexcept {
    return std::span(asked_rad_).first(driving_ ? monitor_.count : 0);
  }

 private:
  static constexpr std::size_t kMaxAxes = protocol::kMaxAxes;
  using Motions = std::array<AxisMotion, kMaxAxes>;

  TableFollower(const Options& options, std::vector<AxisProfile> profiles) noexcept;
  /// Chooses mode and state from what has arrived.
  void choose(std::int64_t now_ns) noexcept;
  /// Writes the demands for `time_ns` into the command.
  void follow(std::int64_t now_ns, std::int64_t time_ns) noexcept;
  /// Returns the motion of all axes that shows a course at an instant, with the angles nearest to
  /// the commands. Beyond the horizon the axes rest.
  [[nodiscard]] Motions motions(const SeekerCourse& course, std::int64_t sim_time_ns) noexcept;
  /// Returns true if an axis is to turn so far that another angle for the same attitude was chosen.
  [[nodiscard]] bool turns_over(const Motions& a, const Motions& b) const noexcept;
  /// Starts the commands where the axes are, with their rates.
  void start_where_axes_are(std::int64_t now_ns) noexcept;
  /// Lets the axes set off softly once more.
  void capture(std::int64_t now_ns) noexcept;
  /// Notes instants of the wall clock, and begins anew where it was set.
  void watch_clock(std::int64_t now_ns) noexcept;
  [[nodiscard]] double share(std::int64_t now_ns) const noexcept;
  void measure_error(const protocol::AxesMonitor& monitor) noexcept;

  Options options_;
  std::vector<AxisProfile> profiles_;
  HostClock clock_;
  SeekerCourse incoming_;            ///< poses as they arrived
  SeekerCourse course_;              ///< poses that the demands follow
  bool incoming_is_new_ = false;     ///< incoming_ has a pose that course_ lacks
  std::int64_t received_ns_ = 0;     ///< when the latest pose arrived
  std::int64_t clock_fault_ns_ = 0;  ///< when simulation time jumped last
  bool clock_jumped_ = false;
  Motions wanted_{};  ///< latest demands without blends
  bool near_lock_ = false;
  std::array<AxisBlend, kMaxAxes> blends_;
  std::int64_t blend_ns_ = 0;     ///< when the blends began, wall
  std::int64_t followed_ns_ = 0;  ///< instant of the latest demands, wall
  std::int64_t offset_ns_ = 0;    ///< from simulation time to time, of the latest demands
  protocol::AxesMonitor monitor_;
  std::int64_t monitor_ns_ = 0;  ///< when monitor_ arrived
  bool has_monitor_ = false;
  std::int64_t taken_ns_ = 0;           ///< when the controller took a new command last
  std::int64_t followed_state_ns_ = 0;  ///< when the controller was following last
  std::int64_t stepped_ns_ = 0;         ///< instant of the latest step
  std::int64_t off_until_ns_ = 0;       ///< motors are switched off until then
  std::int64_t capture_ns_ = 0;         ///< when the axes set off
  std::int64_t unsettled_ns_ = 0;       ///< when an axis did not meet its demand last
  bool captured_ = false;
  bool driving_ = false;  ///< the latest command was to follow
  protocol::AxesCommand command_;
  Status status_;
  std::array<double, kMaxAxes> asked_rad_{};
  double error_rad_ = 0.0;
};

}  // namespace emit::server
