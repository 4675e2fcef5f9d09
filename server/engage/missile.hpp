// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/frames.hpp"

namespace emit::server {

/// Constants of a missile. The defaults are those of an air-to-ground missile of 85 kg and 18 cm.
struct MissileParameters {
  double mass_kg = 85.0;
  double reference_area_m2 = 0.0254;
  double drag_coefficient = 0.30;       ///< without angle of attack
  double induced_drag_per_rad2 = 12.0;  ///< added to the drag coefficient, times angle squared
  double normal_force_per_rad = 24.0;   ///< slope of the normal force over the angle of attack
  double max_angle_of_attack_rad = 0.26;
  double max_acceleration_m_s2 = 250.0;  ///< structural limit of the lateral acceleration
  double autopilot_lag_s = 0.10;         ///< time constant from command to lateral acceleration
  double thrust_n = 0.0;                 ///< along the velocity, while the motor burns
  double burn_s = 0.0;
  double gravity_m_s2 = 9.80665;
  double ground_height_m = 0.0;  ///< of the world origin above sea level, for the density of air
};

/// State of a missile in the world frame (east, north, up).
struct MissileState {
  double time_s = 0.0;  ///< since the launch
  glm::dvec3 position_m{0.0};
  glm::dvec3 velocity_m_s{0.0};
  /// Lateral acceleration by lift, without gravity and drag; perpendicular to the velocity.
  glm::dvec3 lift_m_s2{0.0};
};

/// Returns the density of air by the standard atmosphere's troposphere (ISO 2533), kg/m3. Heights
/// beyond 11 km or below -1 km count as these.
[[nodiscard]] double air_density_kg_m3(double height_m) noexcept;

/// A missile as a point mass with six degrees of freedom in its pose.
///
/// The centre of mass obeys p'' = g + lift + (thrust - drag) v/|v| / m. The autopilot brings the
/// lift to its command with a first-order lag, lift' = (command - lift) / T. The command is limited
/// by the structure and by the lift at the largest angle of attack, q S C_N_alpha alpha_max / m.
/// The body points along the velocity, turned by the angle of attack that the lift needs,
/// alpha = m |lift| / (q S C_N_alpha), and has the least roll. Drag is q S (C_D0 + K alpha^2).
/// Integration is by Runge-Kutta of fourth order.
///
/// Thread: one owner. RT-safe.
class Missile {
 public:
  /// @pre the mass, area, slope, lag and limits are above 0; the speed is above 0
  Missile(const MissileParameters& parameters, const MissileState& launch) noexcept;

  /// Moves on by `step_s` with a constant command of lateral acceleration. The part of the command
  /// along the velocity is ignored.
  /// @pre step_s > 0
  void step(const glm::dvec3& command_m_s2, double step_s) noexcept;

  [[nodiscard]] const MissileState& state() const noexcept { return state_; }
  [[nodiscard]] const MissileParameters& parameters() const noexcept { return parameters_; }
  /// Returns the largest lateral acceleration that the missile can have now.
  [[nodiscard]] double available_m_s2() const noexcept;
  /// Returns the angle of attack, rad.
  [[nodiscard]] double angle_of_attack_rad() const noexcept;
  /// Returns the attitude of the body.
  [[nodiscard]] glm::dquat world_from_body() const noexcept;

 private:
  struct Rates {
    glm::dvec3 velocity_m_s{0.0};
    glm::dvec3 acceleration_m_s2{0.0};
    glm::dvec3 lift_m_s3{0.0};
  };
  [[nodiscard]] double lift_per_rad_m_s2(const MissileState& state) const noexcept;
  [[nodiscard]] double angle_of_attack_rad(const MissileState& state) const noexcept;
  [[nodiscard]] Rates rates(const MissileState& state,
                            const glm::dvec3& command_m_s2) const noexcept;

  MissileParameters parameters_;
  MissileState state_;
};

}  // namespace emit::server
