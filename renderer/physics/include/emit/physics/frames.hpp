// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/ext/vector_double3.hpp>

/// Coordinate frames (conventions.md). World is local east-north-up in metres around the scenario's
/// origin. Body is x forward, y right, z down. Sensor is x right, y down, z along the boresight.
/// Transforms read target_from_source. Quaternions are (w, x, y, z), of unit length, and named
/// `world_from_body`.
namespace emit::physics {

/// Position and attitude of an entity or sensor in the world frame.
struct Pose {
  glm::dvec3 position_world_m{0.0, 0.0, 0.0};
  glm::dquat world_from_body{1.0, 0.0, 0.0, 0.0};
};

/// Returns the rotation of a sensor that looks along the body's x axis, with the body's z axis
/// pointing down in the image: sensor x = body y, sensor y = body z, sensor z = body x.
[[nodiscard]] glm::dmat3 sensor_from_body() noexcept;

/// Returns the attitude from heading (clockwise from north), pitch (nose up) and roll (right side
/// down) in radians. Level flight to the north gives (0, sqrt(1/2), sqrt(1/2), 0).
[[nodiscard]] glm::dquat world_from_body_heading_pitch_roll(double heading_rad, double pitch_rad,
                                                            double roll_rad) noexcept;

/// Returns body_from_turned of a part that is turned against its body by yaw about z, then pitch
/// about y, then roll about x (rad; x forward, y right, z down). RT-safe.
[[nodiscard]] glm::dquat body_from_turned(const glm::dvec3& yaw_pitch_roll_rad) noexcept;

/// Heading, pitch and roll as world_from_body_heading_pitch_roll() takes them.
struct HeadingPitchRoll {
  double heading_rad = 0.0;  ///< [-pi, pi]
  double pitch_rad = 0.0;    ///< [-pi/2, pi/2]
  double roll_rad = 0.0;     ///< [-pi, pi]
};

/// Returns heading, pitch and roll of an attitude. Where the body's x axis is within 1e-9 rad of
/// the vertical, the roll is 0 and the heading holds the whole turn about it.
[[nodiscard]] HeadingPitchRoll heading_pitch_roll(const glm::dquat& world_from_body) noexcept;

/// Returns the attitude whose body x axis points from `eye` to `target`, with the least roll. A
/// direction within 1e-9 rad of the vertical has north at the top of the image.
/// @pre the points differ.
[[nodiscard]] glm::dquat world_from_body_look_at(const glm::dvec3& eye_world_m,
                                                 const glm::dvec3& target_world_m) noexcept;

/// Returns true if every component is finite and the norm of the quaternion lies in [0.99, 1.01].
[[nodiscard]] bool is_valid(const Pose& pose) noexcept;

/// Returns the pose between two poses: linear in position and spherical linear (shortest arc) in
/// attitude. `fraction` is 0 at `from` and 1 at `to`, and is not clamped.
[[nodiscard]] Pose interpolate(const Pose& from, const Pose& to, double fraction) noexcept;

/// Returns true if the poses are less than `distance_m` apart in position and less than `angle_rad`
/// in attitude.
[[nodiscard]] bool close(const Pose& a, const Pose& b, double distance_m,
                         double angle_rad) noexcept;

}  // namespace emit::physics
