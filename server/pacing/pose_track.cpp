// SPDX-License-Identifier: Apache-2.0
#include "pacing/pose_track.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::server {
namespace {

constexpr double kSecondsPerNs = 1e-9;

double seconds(std::int64_t from_ns, std::int64_t to_ns) noexcept {
  return static_cast<double>(to_ns - from_ns) * kSecondsPerNs;
}

/// Constant body rate that turns `from` into `to` within `dt_s` along the shortest arc.
glm::dvec3 angular_rate(const glm::dquat& from, const glm::dquat& to, double dt_s) noexcept {
  glm::dquat turn = glm::conjugate(from) * to;
  if (turn.w < 0.0) {
    turn = -turn;
  }
  const glm::dvec3 axis_sine{turn.x, turn.y, turn.z};
  const double sine = glm::length(axis_sine);
  if (sine < 1e-12) {
    return axis_sine * (2.0 / dt_s);
  }
  return axis_sine * (2.0 * std::atan2(sine, turn.w) / (sine * dt_s));
}

glm::dquat turned(const glm::dquat& attitude, const glm::dvec3& rate_body_rad_s,
                  double dt_s) noexcept {
  const glm::dvec3 half = rate_body_rad_s * (0.5 * dt_s);
  const double angle = glm::length(half);
  const double sinc = angle < 1e-9 ? 1.0 - angle * angle / 6.0 : std::sin(angle) / angle;
  return glm::normalize(attitude *
                        glm::dquat{std::cos(angle), half.x * sinc, half.y * sinc, half.z * sinc});
}

}  // namespace

void PoseTrack::push(const TimedPose& pose) noexcept {
  EMIT_CHECK(empty() || newest().sim_time_ns <= pose.sim_time_ns);
  if (pose.teleport) {
    // Nothing before a jump tells anything about the motion after it; one pose is kept so that
    // instants before the jump still show where the body was.
    const bool had = count_ > 0;
    const TimedPose before = had ? newest() : TimedPose{};
    first_ = 0;
    count_ = 0;
    if (had && before.sim_time_ns < pose.sim_time_ns) {
      poses_[count_++] = before;
    }
  } else if (count_ > 0 && newest().sim_time_ns == pose.sim_time_ns) {
    --count_;
  }
  if (count_ == kHistory) {
    first_ = (first_ + 1) % kHistory;
    --count_;
  }
  poses_[(first_ + count_) % kHistory] = pose;
  ++count_;
}

PoseTrack::Motion PoseTrack::motion_at_newest() const noexcept {
  Motion motion;
  const TimedPose& last = at(count_ - 1);
  const TimedPose* before = nullptr;
  const TimedPose* first = nullptr;
  if (!last.teleport && count_ >= 2) {
    before = &at(count_ - 2);
    if (!before->teleport && count_ >= 3) {
      first = &at(count_ - 3);
    }
  }
  const double dt_s = before != nullptr ? seconds(before->sim_time_ns, last.sim_time_ns) : 0.0;

  if (last.rates) {
    motion.velocity_m_s = last.rates->velocity_world_m_s;
    motion.angular_rate_body_rad_s = last.rates->angular_rate_body_rad_s;
    if (before != nullptr && before->rates) {
      motion.acceleration_m_s2 = (motion.velocity_m_s - before->rates->velocity_world_m_s) / dt_s;
      motion.angular_acceleration_body_rad_s2 =
          (motion.angular_rate_body_rad_s - before->rates->angular_rate_body_rad_s) / dt_s;
    }
    return motion;
  }
  if (before == nullptr) {
    return motion;
  }
  motion.angular_rate_body_rad_s =
      angular_rate(before->pose.world_from_body, last.pose.world_from_body, dt_s);
  const glm::dvec3 mean_velocity =
      (last.pose.position_world_m - before->pose.position_world_m) / dt_s;
  motion.velocity_m_s = mean_velocity;
  if (first != nullptr) {
    // The parabola through three points, which is exact for constant acceleration.
    const double dt_before_s = seconds(first->sim_time_ns, before->sim_time_ns);
    const glm::dvec3 velocity_before =
        (before->pose.position_world_m - first->pose.position_world_m) / dt_before_s;
    motion.acceleration_m_s2 = (mean_velocity - velocity_before) * (2.0 / (dt_s + dt_before_s));
    motion.velocity_m_s = mean_velocity + motion.acceleration_m_s2 * (0.5 * dt_s);
    const glm::dvec3 rate_before =
        angular_rate(first->pose.world_from_body, before->pose.world_from_body, dt_before_s);
    motion.angular_acceleration_body_rad_s2 =
        (motion.angular_rate_body_rad_s - rate_before) * (2.0 / (dt_s + dt_before_s));
    motion.angular_rate_body_rad_s += motion.angular_acceleration_body_rad_s2 * (0.5 * dt_s);
  }
  return motion;
}

PoseSample PoseTrack::sample(std::int64_t sim_time_ns, std::int64_t horizon_ns) const noexcept {
  EMIT_DCHECK_OP(horizon_ns, >=, 0);
  PoseSample out;
  const TimedPose& last = newest();
  out.newest_ns = last.sim_time_ns;
  out.shown_ns = sim_time_ns;
  if (sim_time_ns > last.sim_time_ns) {
    out.stale = sim_time_ns - last.sim_time_ns > horizon_ns;
    if (out.stale) {
      out.shown_ns = last.sim_time_ns + horizon_ns;
    }
    out.extrapolated = out.shown_ns > last.sim_time_ns;
    out.base_ns = last.sim_time_ns;
    const double dt_s = seconds(last.sim_time_ns, out.shown_ns);
    const Motion motion = motion_at_newest();
    out.pose.position_world_m =
        last.pose.position_world_m +
        (motion.velocity_m_s + motion.acceleration_m_s2 * (0.5 * dt_s)) * dt_s;
    out.pose.world_from_body = turned(
        last.pose.world_from_body,
        motion.angular_rate_body_rad_s + motion.angular_acceleration_body_rad_s2 * (0.5 * dt_s),
        dt_s);
    return out;
  }
  for (std::size_t i = count_ - 1;; --i) {
    const TimedPose& to = at(i);
    if (to.sim_time_ns == sim_time_ns || i == 0) {
      out.pose = to.pose;
      out.base_ns = to.sim_time_ns;
      return out;
    }
    const TimedPose& from = at(i - 1);
    if (from.sim_time_ns <= sim_time_ns) {
      out.base_ns = from.sim_time_ns;
      out.pose = to.teleport ? from.pose
                             : physics::interpolate(from.pose, to.pose,
                                                    seconds(from.sim_time_ns, sim_time_ns) /
                                                        seconds(from.sim_time_ns, to.sim_time_ns));
      return out;
    }
  }
}

}  // namespace emit::server
