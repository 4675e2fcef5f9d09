// SPDX-License-Identifier: Apache-2.0
#include "motion/table_follower.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

using protocol::AxesMode;
using protocol::AxesState;
using protocol::MotionState;

/// Time over which a soft start grows to all that the axes have.
constexpr double kSoftStartS = 3.0;
/// Differences from the demand below which an axis has reached it.
constexpr double kReachedRad = 1e-4;
constexpr double kReachedRadS = 1e-2;
/// The axes follow after they have met their demands for so long.
constexpr std::int64_t kSettleNs = 100'000'000;
/// A new pose takes over within the time between two poses, but not within more than this.
constexpr double kLongestBlendS = 0.1;
/// Longest step of the commands. After a longer gap the axes set off from where they were.
constexpr double kLongestStepS = 0.1;
/// Change of a demanded angle from one command to the next that no motion explains.
constexpr double kTurnOverRad = 1.0;
/// The controller may need so long to take a command or to follow.
constexpr std::int64_t kIgnoredNs = 500'000'000;
constexpr std::int64_t kMotorsOffNs = 100'000'000;
/// A jump of simulation time is reported for this long.
constexpr std::int64_t kClockFaultNs = 1'000'000'000;

double seconds_of(std::int64_t ns) noexcept {
  return 1e-9 * static_cast<double>(ns);
}

AxisMotion difference(const AxisMotion& a, const AxisMotion& b) noexcept {
  return {a.angle_rad - b.angle_rad, a.rate_rad_s - b.rate_rad_s,
          a.acceleration_rad_s2 - b.acceleration_rad_s2};
}

AxisMotion sum(const AxisMotion& a, const AxisMotion& b) noexcept {
  return {a.angle_rad + b.angle_rad, a.rate_rad_s + b.rate_rad_s,
          a.acceleration_rad_s2 + b.acceleration_rad_s2};
}

}  // namespace

physics::Result<TableFollower> TableFollower::create(const Options& options) {
  const auto refuse = [](const char* text) {
    return physics::make_error(physics::ErrorCode::invalid_argument, text);
  };
  if (options.axes.size() != 3 && options.axes.size() != 5) {
    return refuse("a motion simulator has three axes, or five with those of the target");
  }
  if (options.period_ns <= 0) return refuse("the period of the commands must be positive");
  if (!(options.soft_frac > 0.0 && options.soft_frac <= 1.0)) {
    return refuse("the share of a soft start must be above 0 and at most 1");
  }
  std::vector<AxisProfile> profiles;
  for (const Axis& axis : options.axes) {
    auto profile = AxisProfile::create(axis.limits);
    if (!profile) return tl::unexpected(std::move(profile.error()));
    if (!(axis.park_rad >= axis.limits.min_rad && axis.park_rad <= axis.limits.max_rad)) {
      return refuse("the park position of an axis is outside of its travel");
    }
    profiles.push_back(*profile);
  }
  return TableFollower(options, std::move(profiles));
}

TableFollower::TableFollower(const Options& options, std::vector<AxisProfile> profiles) noexcept
    : options_(options), profiles_(std::move(profiles)) {
  command_.period_us = static_cast<std::uint32_t>(options.period_ns / 1000);
  command_.timeout_ms = options.controller_timeout_ms;
}

void TableFollower::forget() noexcept {
  clock_.clear();
  incoming_.clear();
  incoming_is_new_ = false;
  clock_jumped_ = false;
  driving_ = false;
}

void TableFollower::reset(std::int64_t now_ns) noexcept {
  forget();
  off_until_ns_ = now_ns + kMotorsOffNs;
}

bool TableFollower::take(const SeekerPose& pose, std::int64_t received_ns) noexcept {
  received_ns_ = received_ns;
  const bool jumped = clock_.arrived(pose.sim_time_ns, received_ns);
  if (jumped) {
    // Poses before the jump tell nothing about the motion after it.
    incoming_.clear_seeker();
    clock_fault_ns_ = received_ns;
    clock_jumped_ = true;
    capture(received_ns);
  }
  incoming_.push(pose);
  incoming_is_new_ = true;
  return !jumped;
}

std::optional<AxisFeedback> TableFollower::take(const protocol::AxesMonitor& monitor,
                                                std::int64_t now_ns) noexcept {
  if (monitor.count != options_.axes.size()) return std::nullopt;
  const bool silent = now_ns - monitor_ns_ > options_.feedback_timeout_ns;
  if (has_monitor_ && monitor.time_ns <= monitor_.time_ns && !silent) return std::nullopt;
  if (!has_monitor_ || monitor.command_counter != monitor_.command_counter) taken_ns_ = now_ns;
  if (monitor.state == AxesState::following || monitor.state == AxesState::capturing) {
    followed_state_ns_ = now_ns;
  }
  monitor_ = monitor;
  monitor_ns_ = now_ns;
  has_monitor_ = true;
  measure_error(monitor);
  AxisFeedback out;
  out.time_ns = monitor.time_ns;
  for (int i = 0; i < 3; ++i) {
    const AxisMotion& axis = monitor.measured[static_cast<std::size_t>(i)];
    out.angles.unit_rad[i] = axis.angle_rad;
    out.unit_rates_rad_s[i] = axis.rate_rad_s;
  }
  for (int i = 0; i < 2 && monitor.count == 5; ++i) {
    const AxisMotion& axis = monitor.measured[static_cast<std::size_t>(3 + i)];
    out.angles.target_rad[i] = axis.angle_rad;
    out.target_rates_rad_s[i] = axis.rate_rad_s;
  }
  return out;
}

void TableFollower::measure_error(const protocol::AxesMonitor& monitor) noexcept {
  error_rad_ = 0.0;
  // The latest command reaches back to the measurement, which is hardly older.
  const double back_s = seconds_of(monitor.time_ns - command_.time_ns);
  for (std::size_t i = 0; i < monitor.count; ++i) {
    const AxisMotion& asked = command_.axes[i];
    asked_rad_[i] =
        asked.angle_rad + back_s * (asked.rate_rad_s + 0.5 * back_s * asked.acceleration_rad_s2);
    if (status_.state != MotionState::following) continue;
    error_rad_ = std::max(error_rad_, std::abs(monitor.measured[i].angle_rad - asked_rad_[i]));
  }
}

void TableFollower::choose(std::int64_t now_ns) noexcept {
  using namespace protocol;
  const bool measured = has_monitor_ && now_ns - monitor_ns_ <= options_.feedback_timeout_ns;
  const std::int64_t clocks_ns = monitor_ns_ - monitor_.time_ns;
  const bool clocks_differ = measured && (clocks_ns > options_.feedback_timeout_ns ||
                                          clocks_ns < -options_.feedback_timeout_ns);
  const bool target = options_.axes.size() == 3 || incoming_.has_target();
  const bool host =
      !incoming_.empty() && target && now_ns - received_ns_ <= options_.host_timeout_ns;
  const bool interlock = measured && monitor_.state == AxesState::fault;
  // A host that comes back may go on at another time.
  if (!incoming_.empty() && now_ns - received_ns_ > options_.host_timeout_ns) {
    clock_.clear();
    incoming_.clear_seeker();
  }
  status_.faults = 0;
  if (!measured) status_.faults |= kMotionNoFeedback;
  if (clocks_differ) status_.faults |= kMotionControllerClock;
  if (!host) status_.faults |= kMotionNoHost;
  if (interlock) status_.faults |= kMotionInterlock;
  const bool follow = status_.faults == 0 && now_ns >= off_until_ns_;
  // The faults below are no reason to park.
  if (clock_jumped_ && now_ns - clock_fault_ns_ <= kClockFaultNs) status_.faults |= kMotionClock;
  if (measured && now_ns - taken_ns_ > kIgnoredNs) status_.faults |= kMotionIgnored;
  command_.mode = now_ns < off_until_ns_ ? AxesMode::off
                  : follow               ? AxesMode::follow
                                         : AxesMode::park;
  if (follow) {
    if (!driving_) {
      start_where_axes_are(now_ns);
      followed_state_ns_ = now_ns;
    }
    // A controller that stopped to follow sets off anew from where its axes are now.
    const std::int64_t stopped_ns = now_ns - followed_state_ns_;
    if (stopped_ns > kSettleNs) start_where_axes_are(now_ns);
    if (stopped_ns > kIgnoredNs) status_.faults |= kMotionIgnored;
    driving_ = true;
    return;
  }
  driving_ = false;
  status_.state = !measured                             ? MotionState::waiting
                  : interlock                           ? MotionState::fault
                  : monitor_.state == AxesState::parked ? MotionState::parked
                                                        : MotionState::parking;
}

void TableFollower::capture(std::int64_t now_ns) noexcept {
  capture_ns_ = now_ns;
  unsettled_ns_ = now_ns;
  captured_ = false;
}

void TableFollower::start_where_axes_are(std::int64_t now_ns) noexcept {
  for (std::size_t i = 0; i < profiles_.size(); ++i) {
    profiles_[i].start(monitor_.measured[i].angle_rad, monitor_.measured[i].rate_rad_s);
    blends_[i].clear();
  }
  course_ = incoming_;
  incoming_is_new_ = false;
  blend_ns_ = now_ns;
  followed_ns_ = now_ns;
  offset_ns_ = now_ns - clock_.sim_time_ns(now_ns);
  wanted_ = motions(course_, clock_.sim_time_ns(now_ns));
  capture(now_ns);
}

void TableFollower::watch_clock(std::int64_t now_ns) noexcept {
  // A clock that was set backwards would keep everything that has come so far for new.
  if (now_ns < stepped_ns_) {
    forget();
    has_monitor_ = false;
    off_until_ns_ = 0;
  }
  // After a gap the axes are elsewhere.
  if (seconds_of(now_ns - stepped_ns_) > kLongestStepS) driving_ = false;
  stepped_ns_ = now_ns;
}

double TableFollower::share(std::int64_t now_ns) const noexcept {
  if (captured_) return 1.0;
  const double grown = std::min(seconds_of(now_ns - capture_ns_) / kSoftStartS, 1.0);
  return options_.soft_frac + (1.0 - options_.soft_frac) * grown;
}

TableFollower::Motions TableFollower::motions(const SeekerCourse& course,
                                              std::int64_t sim_time_ns) noexcept {
  TableMotion near;
  for (std::size_t i = 0; i < 3; ++i) near.unit.rings[i] = profiles_[i].motion();
  if (profiles_.size() == 5) {
    near.target.azimuth = profiles_[3].motion();
    near.target.elevation = profiles_[4].motion();
  }
  const std::int64_t newest_ns = course.newest_ns();
  const std::int64_t shown_ns =
      std::clamp(sim_time_ns, newest_ns - options_.horizon_ns, newest_ns + options_.horizon_ns);
  const TableMotion motion = options_.table.command(course.at(shown_ns), near);
  near_lock_ = motion.unit.near_lock || (profiles_.size() == 5 && motion.target.near_lock);
  Motions out{motion.unit.rings[0], motion.unit.rings[1], motion.unit.rings[2],
              motion.target.azimuth, motion.target.elevation};
  if (shown_ns != sim_time_ns) {
    for (AxisMotion& axis : out) axis = {axis.angle_rad, 0.0, 0.0};
  }
  return out;
}

bool TableFollower::turns_over(const Motions& a, const Motions& b) const noexcept {
  for (std::size_t i = 0; i < profiles_.size(); ++i) {
    if (!(std::abs(a[i].angle_rad - b[i].angle_rad) < kTurnOverRad)) return true;
  }
  return false;
}

void TableFollower::follow(std::int64_t now_ns, std::int64_t time_ns) noexcept {
  const std::int64_t sim_time_ns = clock_.sim_time_ns(time_ns);
  const double since_blend_s = seconds_of(time_ns - blend_ns_);
  // Let a new pose take over from where the old ones had the axes go.
  if (incoming_is_new_) {
    const std::int64_t interval_ns = incoming_.interval_ns();
    const double span_s =
        interval_ns == 0
            ? kLongestBlendS
            : std::clamp(seconds_of(interval_ns), seconds_of(options_.period_ns), kLongestBlendS);
    const Motions old = motions(course_, time_ns - offset_ns_);
    const Motions now = motions(incoming_, sim_time_ns);
    for (std::size_t i = 0; i < profiles_.size(); ++i) {
      blends_[i].start(difference(sum(old[i], blends_[i].at(since_blend_s)), now[i]), span_s);
    }
    blend_ns_ = time_ns;
    course_ = incoming_;
    incoming_is_new_ = false;
  }
  offset_ns_ = time_ns - sim_time_ns;
  const Motions course = motions(course_, sim_time_ns);
  // An axis that has to turn over sets off softly. There is nothing to blend with.
  if (turns_over(course, wanted_)) {
    for (AxisBlend& blend : blends_) blend.clear();
    capture(now_ns);
  }
  wanted_ = course;
  if (sim_time_ns - course_.newest_ns() > options_.horizon_ns) {
    status_.faults |= protocol::kMotionNoHost;
  }
  // A caller that was late has left commands out: the axes have moved on meanwhile.
  const double step_s = std::min(seconds_of(time_ns - followed_ns_), kLongestStepS);
  followed_ns_ = time_ns;
  const double blended_s = seconds_of(time_ns - blend_ns_);
  bool limited = false;
  bool is_outside = false;
  bool reached = true;
  for (std::size_t i = 0; i < profiles_.size(); ++i) {
    AxisMotion demand = sum(course[i], blends_[i].at(blended_s));
    // A number that is none would stay in the commands for ever.
    if (!std::isfinite(demand.angle_rad + demand.rate_rad_s + demand.acceleration_rad_s2)) {
      demand = {profiles_[i].motion().angle_rad, 0.0, 0.0};
      blends_[i].clear();
      limited = true;
    }

    const AxisProfile::Command command = profiles_[i].step(demand, step_s, share(now_ns));
    command_.axes[i] = command.motion;
    limited = limited || command.limited();
    is_outside = is_outside || command.travel_limited;
    reached = reached &&
              std::abs(command.motion.angle_rad - command.wanted.angle_rad) < kReachedRad &&
              std::abs(command.motion.rate_rad_s - command.wanted.rate_rad_s) < kReachedRadS;
  }
  if (!reached || monitor_.state != AxesState::following) unsettled_ns_ = now_ns;
  captured_ = captured_ || now_ns - unsettled_ns_ >= kSettleNs;
  const bool following = captured_ && monitor_.state == AxesState::following;
  status_.state = following ? MotionState::following : MotionState::capturing;
  // Limits of rate and acceleration only say that the axes are under way as long as they set off. A
  // demand outside of the travel is one that they cannot meet however long they take.
  if (is_outside || (following && (limited || monitor_.limited_axes != 0))) {
    status_.faults |= protocol::kMotionLimit;
  }
  if (near_lock_) status_.faults |= protocol::kMotionLock;
}

const protocol::AxesCommand& TableFollower::step(std::int64_t now_ns) noexcept {
  const std::int64_t time_ns = now_ns + options_.period_ns;
  watch_clock(now_ns);
  choose(now_ns);
  // Commands count up by one, from above the last counter of an earlier process: a controller takes
  // no other.
  command_.counter = command_.counter != 0
                         ? command_.counter + 1
                         : static_cast<std::uint64_t>(std::max<std::int64_t>(now_ns / 1000, 1));
  command_.time_ns = time_ns;
  command_.sim_time_ns = clock_.empty() ? 0 : clock_.sim_time_ns(time_ns);
  if (command_.mode == AxesMode::follow) {
    command_.count = profiles_.size();
    follow(now_ns, time_ns);
  } else {
    command_.count = 0;
  }
  return command_;
}

}  // namespace emit::server
