// SPDX-License-Identifier: Apache-2.0
#include "engage/engagement.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Returns the attitude of a head whose optical axis points along `axis`.
glm::dquat attitude_along(const glm::dvec3& axis) noexcept {
  return physics::world_from_body_look_at(glm::dvec3(0.0), axis);
}

/// Returns the angular velocity that turns one attitude into the other, about the body axes.
glm::dvec3 body_rate_rad_s(const glm::dquat& from, const glm::dquat& to, double step_s) noexcept {
  glm::dquat turn = glm::conjugate(from) * to;
  if (turn.w < 0.0) turn = -turn;
  const glm::dvec3 part{turn.x, turn.y, turn.z};
  const double sine = glm::length(part);
  if (sine == 0.0) return glm::dvec3(0.0);
  return part * (2.0 * std::atan2(sine, turn.w) / (sine * step_s));
}

}  // namespace

Engagement::Engagement(const EngagementOptions& options, const MissileState& launch, Target target)
    : options_(options),
      target_(std::move(target)),
      missile_(options.missile, launch),
      head_(options.head, glm::normalize(target_(launch.time_s) - launch.position_m)),
      filter_(options.filter_memory_frac) {
  EMIT_CHECK_OP(options.integration_step_s, >, 0.0);
  closest_.add(launch.time_s, to_target_m());
}

glm::dvec3 Engagement::to_target_m() const noexcept {
  return target_(missile_.state().time_s) - missile_.state().position_m;
}

double Engagement::range_m() const noexcept {
  return glm::length(to_target_m());
}

double Engagement::boresight_error_rad() const noexcept {
  const glm::dvec3 to_target = to_target_m();
  return std::atan2(glm::length(glm::cross(head_.axis(), to_target)),
                    glm::dot(head_.axis(), to_target));
}

physics::Pose Engagement::seeker_pose() const noexcept {
  return {missile_.state().position_m, attitude_along(head_.axis())};
}

protocol::PoseRates Engagement::seeker_rates() const noexcept {
  return {missile_.state().velocity_m_s, head_rate_rad_s_};
}

void Engagement::measure(double time_s, const std::optional<glm::dvec3>& direction) noexcept {
  if (measured_s_ && time_s <= *measured_s_) return;
  measured_s_ = time_s;
  filter_.update(time_s, direction);
}

void Engagement::advance(double step_s) noexcept {
  EMIT_CHECK_OP(step_s, >, 0.0);
  const double end_s = missile_.state().time_s + step_s;
  const auto steps = static_cast<int>(std::ceil(step_s / options_.integration_step_s - 1e-9));
  for (int i = 0; i < steps && !finished_; ++i) {
    const double now_s = missile_.state().time_s;
    const double dt_s = (end_s - now_s) / (steps - i);
    command_m_s2_ =
        proportional_navigation_m_s2(options_.navigation_gain, filter_.rate_rad_s(),
                                     missile_.state().velocity_m_s, options_.missile.gravity_m_s2);
    missile_.step(command_m_s2_, dt_s);
    if (filter_.ready()) {
      const glm::dquat before = attitude_along(head_.axis());
      const glm::dvec3 body_axis = missile_.world_from_body() * glm::dvec3(1.0, 0.0, 0.0);
      head_.step(filter_.direction_at(now_s + dt_s), body_axis, dt_s);
      head_rate_rad_s_ = body_rate_rad_s(before, attitude_along(head_.axis()), dt_s);
    }
    closest_.add(missile_.state().time_s, to_target_m());
    on_ground_ = missile_.state().position_m.z < 0.0;
    finished_ = closest_.passed() || on_ground_;
  }
}

}  // namespace emit::server
