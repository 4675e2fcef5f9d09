// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/geodesy.hpp"
#include "emit/protocol/dis/pdu.hpp"

/// Attitudes of DIS and the prediction of poses between two PDUs (IEEE 1278.1, annex E). Pure
/// functions in double precision. Any thread. RT-safe.
namespace emit::protocol::dis {

/// Returns the rotation from ECEF to the body, Rx(phi) Ry(theta) Rz(psi).
[[nodiscard]] glm::dmat3 body_from_ecef(const EulerAngles& orientation) noexcept;

/// Returns psi, theta and phi of an attitude in double precision: psi and phi within [-pi, pi],
/// theta within [-pi/2, pi/2]. Where the body's x axis is within 1e-9 rad of the ECEF z axis, phi
/// is 0 and psi holds the whole turn about it.
struct EulerAnglesF64 {
  double psi_rad = 0.0;
  double theta_rad = 0.0;
  double phi_rad = 0.0;
};
[[nodiscard]] EulerAnglesF64 euler_angles(const glm::dmat3& body_from_ecef) noexcept;

/// Returns the rotation from the north-east-down frame at a place to ECEF. Its columns are north,
/// east and down.
[[nodiscard]] glm::dmat3 ecef_from_ned(const physics::GeoPlace& place) noexcept;

/// Returns the attitude against north, east and down. euler_angles() of it are heading, pitch and
/// roll: psi of an ECEF attitude is no heading.
[[nodiscard]] glm::dmat3 body_from_ned(const glm::dmat3& body_from_ecef,
                                       const physics::GeoPlace& place) noexcept;

/// Motion of an entity at the instant of its latest PDU.
struct Motion {
  DeadReckoningModel model = DeadReckoningModel::other;
  glm::dvec3 position_ecef_m{0.0};
  glm::dmat3 body_from_ecef{1.0};
  glm::dvec3 velocity_m_s{0.0};            ///< along ECEF axes; along the body's with models 6 to 9
  glm::dvec3 acceleration_m_s2{0.0};       ///< along the axes of the velocity
  glm::dvec3 angular_velocity_rad_s{0.0};  ///< along the body's axes
};
/// Returns the motion that an EntityState says.
[[nodiscard]] Motion motion_of(const EntityState& state) noexcept;

/// Predicted state of an entity.
struct Predicted {
  glm::dvec3 position_ecef_m{0.0};
  glm::dvec3 velocity_ecef_m_s{0.0};
  glm::dmat3 body_from_ecef{1.0};
};

/// Returns the state `dt_s` seconds after the motion's instant, or before it if negative.
///
/// World models: P = P0 + V t + A t^2 / 2, where the models with constant velocity leave out A.
/// Body models: P = P0 + R0^T (R1 Vb + R2 Ab) with R1 the integral of exp(S s) over s from 0 to t,
/// R2 that of s exp(S s), and S the cross-product matrix of the angular velocity. Rotating models
/// turn by R = exp(-S t) R0. The integrals are exact; a series replaces their closed forms at
/// small angles.
///
/// Models 8 and 9: Ab is the rate at which the body's components of the velocity change, so that
/// omega x V is not part of it. Models with a fixed attitude ignore the angular velocity, also in
/// the integrals. `other` and `stationary` stand still. The result is finite for motions of finite
/// numbers as long as the products are.
[[nodiscard]] Predicted predict(const Motion& motion, double dt_s) noexcept;

}  // namespace emit::protocol::dis
