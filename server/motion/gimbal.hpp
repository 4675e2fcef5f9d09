// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/error.hpp"
#include "emit/protocol/axes.hpp"

/// Kinematics of the gimbals of a flight motion simulator. A gimbal stands in a base frame and
/// turns a payload. Both frames are x forward, y right, z down, and agree when all angles are zero.
namespace emit::server {

/// Axis about which a gimbal ring turns: x, y or z of the frame of the ring.
enum class GimbalAxis : std::uint8_t { roll, pitch, yaw };

using protocol::AxisMotion;

/// Three rings that turn about three different axes, in any nesting order. They hold the unit under
/// test. With angles a, b, c of the rings from the outermost to the innermost,
/// base_from_payload = R1(a) R2(b) R3(c).
///
/// Immutable. RT-safe after create().
class ThreeAxisGimbal {
 public:
  /// Motion of the rings, the outermost first.
  struct Motion {
    std::array<AxisMotion, 3> rings;
    /// The outer and the inner axis are nearly parallel: a small motion of the payload takes a
    /// large one of the rings. Rates and accelerations are damped then.
    bool near_lock = false;
  };

  /// Errors: invalid_argument (an axis appears twice).
  [[nodiscard]] static physics::Result<ThreeAxisGimbal> create(
      std::array<GimbalAxis, 3> outer_to_inner);

  /// Returns the attitude of the payload for the angles of the rings, the outermost first.
  [[nodiscard]] glm::dmat3 base_from_payload(const glm::dvec3& angles_rad) const noexcept;

  /// Returns the angles that give the payload an attitude. Two sets of angles do, and each angle
  /// counts in full turns: those nearest to `near_rad` are taken, whatever the travel of the rings.
  /// In gimbal lock the outer ring stays at `near_rad`.
  /// @pre `base_from_payload` is a rotation
  [[nodiscard]] glm::dvec3 angles_rad(const glm::dmat3& base_from_payload,
                                      const glm::dvec3& near_rad) const noexcept;

  /// Returns the motion of the rings that gives the payload an attitude, an angular velocity and an
  /// angular acceleration, both in axes of the payload. With the columns of J, the axes of the
  /// rings in the payload, w = J x' and dw/dt = J x'' + J' x'.
  /// @pre `base_from_payload` is a rotation
  [[nodiscard]] Motion motion(const glm::dmat3& base_from_payload,
                              const glm::dvec3& angular_velocity_rad_s,
                              const glm::dvec3& angular_acceleration_rad_s2,
                              const glm::dvec3& near_rad) const noexcept;

  /// Returns the angular velocity of the payload in its own axes.
  [[nodiscard]] glm::dvec3 angular_velocity_rad_s(const glm::dvec3& angles_rad,
                                                  const glm::dvec3& rates_rad_s) const noexcept;

 private:
  explicit ThreeAxisGimbal(std::array<glm::length_t, 3> axes, double parity)
      : axes_(axes), parity_(parity) {}
  /// Returns the axes of the rings as columns, in axes of the payload.
  [[nodiscard]] glm::dmat3 ring_axes(const glm::dvec3& angles_rad) const noexcept;

  std::array<glm::length_t, 3> axes_;  ///< index of the axis of each ring, the outermost first
  double parity_;                      ///< +1 for the orders xyz, yzx and zxy, else -1
};

/// Two rings that turn about y and z. They hold the target or the projector, whose x axis points
/// where the target is to appear.
///
/// Immutable. RT-safe.
class TwoAxisGimbal {
 public:
  enum class Outer : std::uint8_t { azimuth, elevation };
  struct Motion {
    AxisMotion azimuth;    ///< about z: positive to the right
    AxisMotion elevation;  ///< about y: positive upwards
    /// The target stands nearly on the outer axis. Rate and acceleration of the outer ring are
    /// damped then.
    bool near_lock = false;
  };

  explicit TwoAxisGimbal(Outer outer) noexcept : outer_(outer) {}

  [[nodiscard]] glm::dmat3 base_from_payload(double azimuth_rad,
                                             double elevation_rad) const noexcept;

  /// Returns the motion of the rings that keeps the payload's x axis on a target. The vector to the
  /// target and its derivatives are in axes of the base, of any length. On the outer axis the outer
  /// ring stays at its angle in `near`. The inner ring stays within a right angle, so that a target
  /// which passes the outer axis asks the outer ring for half a turn.
  /// @pre `target_m` is not zero
  [[nodiscard]] Motion motion(const glm::dvec3& target_m, const glm::dvec3& velocity_m_s,
                              const glm::dvec3& acceleration_m_s2,
                              const Motion& near) const noexcept;

 private:
  Outer outer_;
};

}  // namespace emit::server
