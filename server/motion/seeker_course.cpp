// SPDX-License-Identifier: Apache-2.0
#include "motion/seeker_course.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::server {
namespace {

double seconds_between(std::int64_t from_ns, std::int64_t to_ns) noexcept {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}

/// Returns the constant body rate that turns `from` into `to` along the shortest arc.
glm::dvec3 mean_turn_rad_s(const glm::dquat& from, const glm::dquat& to, double span_s) noexcept {
  glm::dquat turn = glm::conjugate(from) * to;
  if (turn.w < 0.0) turn = -turn;
  const glm::dvec3 axis_sine{turn.x, turn.y, turn.z};
  const double sine = glm::length(axis_sine);
  const double angle_per_sine = sine < 1e-9 ? 2.0 : 2.0 * std::atan2(sine, turn.w) / sine;
  return axis_sine * (angle_per_sine / span_s);
}

glm::dquat rotation_of(const glm::dvec3& turn_rad) noexcept {
  const glm::dvec3 half = 0.5 * turn_rad;
  const double angle = glm::length(half);
  const double sinc = angle < 1e-9 ? 1.0 : std::sin(angle) / angle;
  return {std::cos(angle), half.x * sinc, half.y * sinc, half.z * sinc};
}

/// Slope at the end of the parabola through three points, and its curvature.
struct Parabola {
  glm::dvec3 slope{0.0};
  glm::dvec3 curvature{0.0};
};
/// Returns the parabola whose mean slopes over two spans, one behind the other, are given.
Parabola parabola(const glm::dvec3& first_mean, double first_s, const glm::dvec3& last_mean,
                  double last_s) noexcept {
  const glm::dvec3 curvature = (last_mean - first_mean) * (2.0 / (first_s + last_s));
  return {last_mean + curvature * (0.5 * last_s), curvature};
}

}  // namespace

void SeekerCourse::push(const SeekerPose& pose) noexcept {
  if (count_ > 0 && pose.sim_time_ns < newest_ns()) return;
  if (count_ > 0 && pose.sim_time_ns == newest_ns()) --count_;
  if (count_ == poses_.size()) {
    poses_[0] = poses_[1];
    poses_[1] = poses_[2];
    --count_;
  }
  poses_[count_++] = pose;
}

SeekerCourse::Rates SeekerCourse::rates() const noexcept {
  Rates out;
  const SeekerPose& last = poses_[count_ - 1];
  const auto to_target = [](const SeekerPose& pose) {
    return pose.target_m - pose.seeker.position_world_m;
  };
  // Take differences, as far as there are poses.
  if (count_ >= 2) {
    const SeekerPose& before = poses_[count_ - 2];
    const double last_s = seconds_between(before.sim_time_ns, last.sim_time_ns);
    const glm::dvec3 turn =
        mean_turn_rad_s(before.seeker.world_from_body, last.seeker.world_from_body, last_s);
    const glm::dvec3 velocity = (to_target(last) - to_target(before)) / last_s;
    out.turn_rad_s = turn;
    out.target_velocity_m_s = velocity;
    if (count_ == 3) {
      const SeekerPose& first = poses_[0];
      const double first_s = seconds_between(first.sim_time_ns, before.sim_time_ns);
      const Parabola turns = parabola(
          mean_turn_rad_s(first.seeker.world_from_body, before.seeker.world_from_body, first_s),
          first_s, turn, last_s);
      const Parabola way =
          parabola((to_target(before) - to_target(first)) / first_s, first_s, velocity, last_s);
      out.turn_rad_s = turns.slope;
      out.turn_acceleration_rad_s2 = turns.curvature;
      out.target_velocity_m_s = way.slope;
      out.target_acceleration_m_s2 = way.curvature;
    }
    // Rates of the host are better than differences, and so are their differences.
    if (last.seeker_rates && before.seeker_rates) {
      out.turn_acceleration_rad_s2 = (last.seeker_rates->angular_rate_body_rad_s -
                                      before.seeker_rates->angular_rate_body_rad_s) /
                                     last_s;
    }
  }
  if (last.seeker_rates) {
    out.turn_rad_s = last.seeker_rates->angular_rate_body_rad_s;
    if (last.target_velocity_m_s) {
      out.target_velocity_m_s = *last.target_velocity_m_s - last.seeker_rates->velocity_world_m_s;
    }
  }
  return out;
}

SeekerState SeekerCourse::at(std::int64_t sim_time_ns) const noexcept {
  EMIT_DCHECK(!empty());
  const SeekerPose& last = poses_[count_ - 1];
  const Rates rate = rates();
  const double after_s = seconds_between(last.sim_time_ns, sim_time_ns);
  SeekerState out;
  // The attitude follows from the turn alone as long as its axis hardly moves within `after_s`.
  out.world_from_seeker = glm::mat3_cast(glm::normalize(
      last.seeker.world_from_body *
      rotation_of(after_s * (rate.turn_rad_s + 0.5 * after_s * rate.turn_acceleration_rad_s2))));
  out.angular_velocity_rad_s = rate.turn_rad_s + after_s * rate.turn_acceleration_rad_s2;
  out.angular_acceleration_rad_s2 = rate.turn_acceleration_rad_s2;
  out.target_m =
      last.target_m - last.seeker.position_world_m +
      after_s * (rate.target_velocity_m_s + 0.5 * after_s * rate.target_acceleration_m_s2);
  out.target_velocity_m_s = rate.target_velocity_m_s + after_s * rate.target_acceleration_m_s2;
  out.target_acceleration_m_s2 = rate.target_acceleration_m_s2;
  constexpr double kNearestM = 1e-6;
  if (!(glm::length(out.target_m) > kNearestM)) {
    out.target_m = out.world_from_seeker[0];
    out.target_velocity_m_s = glm::dvec3(0.0);
    out.target_acceleration_m_s2 = glm::dvec3(0.0);
  }
  return out;
}

}  // namespace emit::server
