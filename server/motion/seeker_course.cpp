// SPDX-License-Identifier: Apache-2.0
#include "motion/seeker_course.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::server {
namespace {

double seconds_between(const SeekerPose& from, const SeekerPose& to) noexcept {
  return 1e-9 * static_cast<double>(to.sim_time_ns - from.sim_time_ns);
}

/// Returns the constant body rate that turns `from` into `to` along the shortest arc.
glm::dvec3 mean_turn_rad_s(const SeekerPose& from, const SeekerPose& to) noexcept {
  glm::dquat turn = glm::conjugate(from.seeker.world_from_body) * to.seeker.world_from_body;
  if (turn.w < 0.0) turn = -turn;
  const glm::dvec3 axis_sine{turn.x, turn.y, turn.z};
  const double sine = glm::length(axis_sine);
  const double angle_per_sine = sine < 1e-9 ? 2.0 : 2.0 * std::atan2(sine, turn.w) / sine;
  return axis_sine * (angle_per_sine / seconds_between(from, to));
}

glm::dquat rotation_of(const glm::dvec3& turn_rad) noexcept {
  const glm::dvec3 half = 0.5 * turn_rad;
  const double angle = glm::length(half);
  const double sinc = angle < 1e-9 ? 1.0 : std::sin(angle) / angle;
  return {std::cos(angle), half.x * sinc, half.y * sinc, half.z * sinc};
}

}  // namespace

void SeekerCourse::push(const SeekerPose& pose) noexcept {
  TimedPoint place{pose.sim_time_ns, pose.seeker.position_world_m, std::nullopt, false};
  if (pose.rates) place.velocity_m_s = pose.rates->velocity_world_m_s;
  position_.push(place);
  if (count_ > 0) {
    const std::int64_t after_ns = pose.sim_time_ns - newest_ns();
    if (after_ns < 0) return;
    if (after_ns == 0) {
      // Time stands, and so does the seeker, whatever its rates are.
      poses_[0] = pose;
      poses_[0].rates.reset();
      count_ = 1;
      return;
    }
    if (after_ns < kLeastIntervalNs) --count_;
  }
  if (count_ == poses_.size()) {
    poses_[0] = poses_[1];
    poses_[1] = poses_[2];
    --count_;
  }
  poses_[count_++] = pose;
}

SeekerCourse::Turn SeekerCourse::turn() const noexcept {
  Turn out;
  const SeekerPose& last = poses_[count_ - 1];
  if (count_ >= 2) {
    const SeekerPose& before = poses_[count_ - 2];
    out.rate_rad_s = mean_turn_rad_s(before, last);
    if (last.rates && before.rates) {
      out.acceleration_rad_s2 =
          (last.rates->angular_rate_body_rad_s - before.rates->angular_rate_body_rad_s) /
          seconds_between(before, last);
    } else if (count_ == 3 && !last.rates) {
      const SeekerPose& first = poses_[0];
      const Parabola turns =
          parabola(mean_turn_rad_s(first, before), seconds_between(first, before), out.rate_rad_s,
                   seconds_between(before, last));
      out = {turns.slope, turns.curvature};
    }
  }
  if (last.rates) out.rate_rad_s = last.rates->angular_rate_body_rad_s;
  return out;
}

SeekerState SeekerCourse::at(std::int64_t sim_time_ns) const noexcept {
  EMIT_DCHECK(!empty());
  const SeekerPose& last = poses_[count_ - 1];
  const Turn now = turn();
  const double after_s = 1e-9 * static_cast<double>(sim_time_ns - last.sim_time_ns);
  SeekerState out;
  // The attitude follows from the turn alone as long as its axis hardly moves within `after_s`.
  out.world_from_seeker = glm::mat3_cast(glm::normalize(
      last.seeker.world_from_body *
      rotation_of(after_s * (now.rate_rad_s + 0.5 * after_s * now.acceleration_rad_s2))));
  out.angular_velocity_rad_s = now.rate_rad_s + after_s * now.acceleration_rad_s2;
  out.angular_acceleration_rad_s2 = now.acceleration_rad_s2;
  constexpr double kNearestM = 1e-6;
  out.target_m = out.world_from_seeker[0];
  if (has_target()) {
    const PointCourse::State target = target_.at(sim_time_ns);
    const PointCourse::State own = position_.at(sim_time_ns);
    const glm::dvec3 way_m = target.position_m - own.position_m;
    if (glm::length(way_m) > kNearestM) {
      out.target_m = way_m;
      out.target_velocity_m_s = target.velocity_m_s - own.velocity_m_s;
      out.target_acceleration_m_s2 = target.acceleration_m_s2 - own.acceleration_m_s2;
    }
  }
  return out;
}

}  // namespace emit::server
