// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/gtc/quaternion.hpp>

namespace emit::server {

/// Returns body_from_turned of a part that is turned against its body by yaw about z, then pitch
/// about y, then roll about x (rad; x forward, y right, z down). RT-safe.
[[nodiscard]] inline glm::dquat turn_of(const glm::dvec3& yaw_pitch_roll_rad) noexcept {
  return glm::angleAxis(yaw_pitch_roll_rad.x, glm::dvec3(0.0, 0.0, 1.0)) *
         glm::angleAxis(yaw_pitch_roll_rad.y, glm::dvec3(0.0, 1.0, 0.0)) *
         glm::angleAxis(yaw_pitch_roll_rad.z, glm::dvec3(1.0, 0.0, 0.0));
}

}  // namespace emit::server
