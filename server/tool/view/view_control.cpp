// SPDX-License-Identifier: Apache-2.0
#include "tool/view/view_control.hpp"

#include <glm/gtc/quaternion.hpp>

namespace emit::tool::view {

physics::Pose turned_pose(const physics::Pose& base, const ViewControl& control) noexcept {
  const glm::dquat yaw = glm::angleAxis(-control.yaw_rad, glm::dvec3(0.0, 0.0, 1.0));
  const glm::dquat pitch = glm::angleAxis(control.pitch_rad, glm::dvec3(0.0, 1.0, 0.0));
  physics::Pose pose = base;
  pose.world_from_body = glm::normalize(yaw * base.world_from_body * pitch);
  return pose;
}

glm::dvec3 step_world_m(const physics::Pose& base, const ViewControl& control) noexcept {
  return turned_pose(base, control).world_from_body *
             glm::dvec3(control.forward_m, control.right_m, 0.0) +
         glm::dvec3(0.0, 0.0, control.up_m);
}

}  // namespace emit::tool::view
