// SPDX-License-Identifier: Apache-2.0
#include "engage/missile.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Returns the part of `v` that is perpendicular to the unit vector `axis`.
glm::dvec3 perpendicular(const glm::dvec3& v, const glm::dvec3& axis) noexcept {
  return v - glm::dot(v, axis) * axis;
}

glm::dvec3 limited(const glm::dvec3& v, double most) noexcept {
  const double length = glm::length(v);
  return length > most ? v * (most / length) : v;
}

}  // namespace

double air_density_kg_m3(double height_m) noexcept {
  constexpr double kEarthRadiusM = 6356766.0;
  const double height = std::clamp(height_m, -1000.0, 11000.0);
  const double geopotential = kEarthRadiusM * height / (kEarthRadiusM + height);
  return 1.225 * std::pow(1.0 - 2.25577e-5 * geopotential, 4.25588);
}

Missile::Missile(const MissileParameters& parameters, const MissileState& launch) noexcept
    : parameters_(parameters), state_(launch) {
  EMIT_CHECK_OP(parameters.mass_kg, >, 0.0);
  EMIT_CHECK_OP(parameters.reference_area_m2, >, 0.0);
  EMIT_CHECK_OP(parameters.normal_force_per_rad, >, 0.0);
  EMIT_CHECK_OP(parameters.max_angle_of_attack_rad, >, 0.0);
  EMIT_CHECK_OP(parameters.max_acceleration_m_s2, >, 0.0);
  EMIT_CHECK_OP(parameters.autopilot_lag_s, >, 0.0);
  EMIT_CHECK_OP(glm::length(launch.velocity_m_s), >, 0.0);
}

double Missile::lift_per_rad_m_s2(const MissileState& state) const noexcept {
  const double speed = glm::length(state.velocity_m_s);
  const double density = air_density_kg_m3(parameters_.ground_height_m + state.position_m.z);
  return 0.5 * density * speed * speed * parameters_.reference_area_m2 *
         parameters_.normal_force_per_rad / parameters_.mass_kg;
}

double Missile::angle_of_attack_rad(const MissileState& state) const noexcept {
  const double slope = lift_per_rad_m_s2(state);
  return slope > 0.0 ? glm::length(state.lift_m_s2) / slope : 0.0;
}

double Missile::angle_of_attack_rad() const noexcept {
  return angle_of_attack_rad(state_);
}

double Missile::available_m_s2() const noexcept {
  return std::min(parameters_.max_acceleration_m_s2,
                  parameters_.max_angle_of_attack_rad * lift_per_rad_m_s2(state_));
}

Missile::Rates Missile::rates(const MissileState& state,
                              const glm::dvec3& command_m_s2) const noexcept {
  const MissileParameters& p = parameters_;
  const double speed = glm::length(state.velocity_m_s);
  const glm::dvec3 forward = state.velocity_m_s / speed;
  const double density = air_density_kg_m3(p.ground_height_m + state.position_m.z);
  const double alpha = angle_of_attack_rad(state);
  const double drag_n = 0.5 * density * speed * speed * p.reference_area_m2 *
                        (p.drag_coefficient + p.induced_drag_per_rad2 * alpha * alpha);
  const double thrust_n = state.time_s < p.burn_s ? p.thrust_n : 0.0;
  Rates out;
  out.velocity_m_s = state.velocity_m_s;
  out.acceleration_m_s2 = perpendicular(state.lift_m_s2, forward) +
                          forward * ((thrust_n - drag_n) / p.mass_kg) -
                          glm::dvec3(0.0, 0.0, p.gravity_m_s2);
  out.lift_m_s3 = (command_m_s2 - state.lift_m_s2) / p.autopilot_lag_s;
  return out;
}

void Missile::step(const glm::dvec3& command_m_s2, double step_s) noexcept {
  EMIT_CHECK_OP(step_s, >, 0.0);
  const glm::dvec3 forward = glm::normalize(state_.velocity_m_s);
  const glm::dvec3 command = limited(perpendicular(command_m_s2, forward), available_m_s2());
  const auto moved = [this](const Rates& rates, double by_s) {
    MissileState out = state_;
    out.time_s += by_s;
    out.position_m += by_s * rates.velocity_m_s;
    out.velocity_m_s += by_s * rates.acceleration_m_s2;
    out.lift_m_s2 += by_s * rates.lift_m_s3;
    return out;
  };
  const Rates a = rates(state_, command);
  const Rates b = rates(moved(a, 0.5 * step_s), command);
  const Rates c = rates(moved(b, 0.5 * step_s), command);
  const Rates d = rates(moved(c, step_s), command);
  const auto mean = [](const glm::dvec3& first, const glm::dvec3& second, const glm::dvec3& third,
                       const glm::dvec3& fourth) {
    return (first + 2.0 * second + 2.0 * third + fourth) / 6.0;
  };
  const Rates slope{
      mean(a.velocity_m_s, b.velocity_m_s, c.velocity_m_s, d.velocity_m_s),
      mean(a.acceleration_m_s2, b.acceleration_m_s2, c.acceleration_m_s2, d.acceleration_m_s2),
      mean(a.lift_m_s3, b.lift_m_s3, c.lift_m_s3, d.lift_m_s3)};
  state_ = moved(slope, step_s);
  // The velocity has turned, and the lift stays perpendicular to it.
  state_.lift_m_s2 = perpendicular(state_.lift_m_s2, glm::normalize(state_.velocity_m_s));
}

glm::dquat Missile::world_from_body() const noexcept {
  const glm::dvec3 forward = glm::normalize(state_.velocity_m_s);
  glm::dvec3 axis = forward;
  if (const double lift = glm::length(state_.lift_m_s2); lift > 0.0) {
    const double alpha = angle_of_attack_rad();
    axis = std::cos(alpha) * forward + std::sin(alpha) * (state_.lift_m_s2 / lift);
  }
  return physics::world_from_body_look_at(glm::dvec3(0.0), axis);
}

}  // namespace emit::server
