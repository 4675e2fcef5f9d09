// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/ext/vector_double3.hpp>

/// Frames (conventions.md): world = local east-north-up metres around the scenario origin;
/// body = x forward, y right, z down; sensor = x right, y down, z along the boresight.
/// Transforms read target_from_source. Quaternions are (w, x, y, z), unit length,
/// `world_from_body`.
namespace emit::physics {

/// Position and attitude of a body in the world frame.
struct Pose {
  glm::dvec3 position_world_m{0.0, 0.0, 0.0};
  glm::dquat world_from_body{1.0, 0.0, 0.0, 0.0};
};

/// Rotation of a sensor that looks along the body's x axis with the body's z axis pointing down
/// in the image: sensor x = body y, sensor y = body z, sensor z = body x.
[[nodiscard]] glm::dmat3 sensor_from_body() noexcept;

/// Attitude from heading (clockwise from north), pitch (nose up) and roll (right side down), rad.
/// Level and heading north is (0, sqrt(1/2), sqrt(1/2), 0).
[[nodiscard]] glm::dquat world_from_body_heading_pitch_roll(double heading_rad, double pitch_rad,
                                                            double roll_rad) noexcept;

/// Attitude whose body x axis points from `eye` to `target`, with the least roll.
/// Precondition: the points differ and the direction is not vertical within 1e-9 rad; a vertical
/// direction is resolved with north at the top of the image.
[[nodiscard]] glm::dquat world_from_body_look_at(const glm::dvec3& eye_world_m,
                                                 const glm::dvec3& target_world_m) noexcept;

/// True when every component is finite and the quaternion's norm lies in [0.99, 1.01].
[[nodiscard]] bool is_valid(const Pose& pose) noexcept;

/// Linear in position, spherical linear (shortest arc) in attitude; `fraction` is not clamped.
[[nodiscard]] Pose interpolate(const Pose& from, const Pose& to, double fraction) noexcept;

/// True when the poses lie less than that far apart, in position and in attitude.
[[nodiscard]] bool close(const Pose& a, const Pose& b, double distance_m,
                         double angle_rad) noexcept;

}  // namespace emit::physics
