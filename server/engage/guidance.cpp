// SPDX-License-Identifier: Apache-2.0
#include "engage/guidance.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

/// Returns the unit vector `v`, turned about `turn` by its length in radians.
glm::dvec3 turned(const glm::dvec3& v, const glm::dvec3& turn) noexcept {
  const double angle = glm::length(turn);
  if (angle == 0.0) return v;
  const glm::dvec3 axis = turn / angle;
  return glm::normalize(std::cos(angle) * v + std::sin(angle) * glm::cross(axis, v) +
                        (1.0 - std::cos(angle)) * glm::dot(axis, v) * axis);
}

/// Returns the rotation vector that brings the unit vector `from` to `to` on the shortest way.
glm::dvec3 turn_between(const glm::dvec3& from, const glm::dvec3& to) noexcept {
  const glm::dvec3 normal = glm::cross(from, to);
  const double sine = glm::length(normal);
  if (sine == 0.0) return glm::dvec3(0.0);
  return normal * (std::atan2(sine, glm::dot(from, to)) / sine);
}

}  // namespace

LineOfSightFilter::LineOfSightFilter(double memory_frac) noexcept : memory_frac_(memory_frac) {
  EMIT_CHECK_OP(memory_frac, >=, 0.0);
  EMIT_CHECK_OP(memory_frac, <, 1.0);
}

void LineOfSightFilter::update(double time_s, const std::optional<glm::dvec3>& direction) noexcept {
  if (!ready_) {
    if (!direction) return;
    ready_ = true;
    direction_ = *direction;
    time_s_ = time_s;
    return;
  }
  const double step_s = time_s - time_s_;
  EMIT_CHECK_OP(step_s, >, 0.0);
  const glm::dvec3 predicted = direction_at(time_s);
  time_s_ = time_s;
  direction_ = predicted;
  if (direction) {
    const glm::dvec3 residual = turn_between(predicted, *direction);
    const double loss = 1.0 - memory_frac_;
    direction_ = turned(predicted, (1.0 - memory_frac_ * memory_frac_) * residual);
    rate_rad_s_ += (loss * loss / step_s) * residual;
  }
  rate_rad_s_ -= glm::dot(rate_rad_s_, direction_) * direction_;
}

glm::dvec3 LineOfSightFilter::direction_at(double time_s) const noexcept {
  EMIT_CHECK(ready_);
  return turned(direction_, (time_s - time_s_) * rate_rad_s_);
}

glm::dvec3 proportional_navigation_m_s2(double gain, const glm::dvec3& rate_rad_s,
                                        const glm::dvec3& velocity_m_s,
                                        double gravity_m_s2) noexcept {
  const glm::dvec3 forward = glm::normalize(velocity_m_s);
  const glm::dvec3 up{0.0, 0.0, gravity_m_s2};
  return gain * glm::cross(rate_rad_s, velocity_m_s) + up - glm::dot(up, forward) * forward;
}

SeekerHead::SeekerHead(const Limits& limits, const glm::dvec3& axis) noexcept
    : limits_(limits), axis_(axis) {
  EMIT_CHECK_OP(limits.lag_s, >, 0.0);
  EMIT_CHECK_OP(limits.max_rate_rad_s, >, 0.0);
  EMIT_CHECK_OP(limits.max_look_rad, >, 0.0);
  EMIT_CHECK_OP(limits.max_look_rad, <, physics::kPi);
  EMIT_CHECK_OP(std::abs(glm::length(axis) - 1.0), <, 1e-6);
}

void SeekerHead::step(const glm::dvec3& direction, const glm::dvec3& body_axis,
                      double step_s) noexcept {
  glm::dvec3 turn = (1.0 - std::exp(-step_s / limits_.lag_s)) * turn_between(axis_, direction);
  const double most_rad = limits_.max_rate_rad_s * step_s;
  if (const double angle = glm::length(turn); angle > most_rad) turn *= most_rad / angle;
  axis_ = turned(axis_, turn);
  const glm::dvec3 look = turn_between(body_axis, axis_);
  const double look_rad = glm::length(look);
  at_limit_ = look_rad > limits_.max_look_rad;
  if (at_limit_) axis_ = turned(body_axis, look * (limits_.max_look_rad / look_rad));
}

void ClosestApproach::add(double time_s, const glm::dvec3& target_from_missile_m) noexcept {
  if (!started_) {
    started_ = true;
    nearest_time_s_ = time_s;
    nearest_m_ = target_from_missile_m;
  } else {
    const glm::dvec3 way = target_from_missile_m - last_m_;
    const double way2 = glm::dot(way, way);
    const double share = way2 > 0.0 ? std::clamp(-glm::dot(last_m_, way) / way2, 0.0, 1.0) : 0.0;
    const glm::dvec3 nearest = last_m_ + share * way;
    if (glm::length(nearest) < glm::length(nearest_m_)) {
      nearest_m_ = nearest;
      nearest_time_s_ = last_time_s_ + share * (time_s - last_time_s_);
    }
    passed_ = glm::length(target_from_missile_m) > glm::length(last_m_);
  }
  last_time_s_ = time_s;
  last_m_ = target_from_missile_m;
}

double ClosestApproach::distance_m() const noexcept {
  return glm::length(nearest_m_);
}

}  // namespace emit::server
