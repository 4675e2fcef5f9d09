// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/frames.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

constexpr double kSqrtHalf = 0.70710678118654752440;
// Sine of the smallest angle to the vertical at which the horizon still defines a heading.
constexpr double kVerticalSine = 1e-9;

/// Rotation of east-north-up from north-east-down: half a turn about the axis between north and
/// east.
const glm::dquat kEnuFromNed(0.0, kSqrtHalf, kSqrtHalf, 0.0);

glm::dquat about_axis(double angle_rad, const glm::dvec3& axis) noexcept {
  const double s = std::sin(0.5 * angle_rad);
  return {std::cos(0.5 * angle_rad), axis.x * s, axis.y * s, axis.z * s};
}

}  // namespace

glm::dmat3 sensor_from_body() noexcept {
  // Columns are the images of the body axes: forward is the boresight, right is x, down is y.
  return {glm::dvec3(0.0, 0.0, 1.0), glm::dvec3(1.0, 0.0, 0.0), glm::dvec3(0.0, 1.0, 0.0)};
}

glm::dquat world_from_body_heading_pitch_roll(double heading_rad, double pitch_rad,
                                              double roll_rad) noexcept {
  const glm::dquat ned_from_body = about_axis(heading_rad, {0.0, 0.0, 1.0}) *
                                   about_axis(pitch_rad, {0.0, 1.0, 0.0}) *
                                   about_axis(roll_rad, {1.0, 0.0, 0.0});
  return glm::normalize(kEnuFromNed * ned_from_body);
}

glm::dquat body_from_turned(const glm::dvec3& yaw_pitch_roll_rad) noexcept {
  return glm::angleAxis(yaw_pitch_roll_rad.x, glm::dvec3(0.0, 0.0, 1.0)) *
         glm::angleAxis(yaw_pitch_roll_rad.y, glm::dvec3(0.0, 1.0, 0.0)) *
         glm::angleAxis(yaw_pitch_roll_rad.z, glm::dvec3(1.0, 0.0, 0.0));
}

HeadingPitchRoll heading_pitch_roll(const glm::dquat& world_from_body) noexcept {
  const glm::dmat3 ned_from_body =
      glm::mat3_cast(glm::normalize(glm::conjugate(kEnuFromNed) * world_from_body));
  const glm::dvec3& forward = ned_from_body[0];
  const glm::dvec3& right = ned_from_body[1];
  const double cos_pitch = std::hypot(forward.x, forward.y);
  HeadingPitchRoll out;
  out.pitch_rad = std::atan2(-forward.z, cos_pitch);
  if (cos_pitch > kVerticalSine) {
    out.heading_rad = std::atan2(forward.y, forward.x);
    out.roll_rad = std::atan2(right.z, ned_from_body[2].z);
  } else {
    out.heading_rad = std::atan2(-right.x, right.y);
  }
  return out;
}

glm::dquat world_from_body_look_at(const glm::dvec3& eye_world_m,
                                   const glm::dvec3& target_world_m) noexcept {
  EMIT_CHECK(eye_world_m != target_world_m);
  const glm::dvec3 forward = glm::normalize(target_world_m - eye_world_m);
  const glm::dvec3 up(0.0, 0.0, 1.0);
  glm::dvec3 right = glm::cross(forward, up);
  const double sine = glm::length(right);
  // If the camera looks straight up or down, north is at the top of the image, so the body's z axis
  // points south.
  right = sine > kVerticalSine ? right / sine
                               : glm::normalize(glm::cross(glm::dvec3(0.0, -1.0, 0.0), forward));
  const glm::dvec3 down = glm::cross(forward, right);
  return glm::normalize(glm::quat_cast(glm::dmat3(forward, right, down)));
}

bool is_valid(const Pose& pose) noexcept {
  const glm::dvec3& p = pose.position_world_m;
  const glm::dquat& q = pose.world_from_body;
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
    return false;
  }
  // A NaN component makes the norm NaN, which fails the comparison.
  const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return norm >= 0.99 && norm <= 1.01;
}

Pose interpolate(const Pose& from, const Pose& to, double fraction) noexcept {
  Pose pose;
  pose.position_world_m =
      from.position_world_m + (to.position_world_m - from.position_world_m) * fraction;
  pose.world_from_body = glm::normalize(glm::slerp(glm::normalize(from.world_from_body),
                                                   glm::normalize(to.world_from_body), fraction));
  return pose;
}

bool close(const Pose& a, const Pose& b, double distance_m, double angle_rad) noexcept {
  if (!(glm::distance(a.position_world_m, b.position_world_m) < distance_m)) return false;
  const double half_cos = std::min(1.0, std::abs(glm::dot(a.world_from_body, b.world_from_body)));
  return 2.0 * std::acos(half_cos) < angle_rad;
}

}  // namespace emit::physics
