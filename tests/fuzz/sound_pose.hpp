// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>

#include "emit/physics/constants.hpp"
#include "emit/protocol/codec.hpp"
#include "fuzz/fuzz_input.hpp"

/// Checks of the promises that an accepted host frame makes.
namespace emit::fuzz {

inline void require_sound(const physics::Pose& pose) {
  const auto& p = pose.position_world_m;
  const auto& q = pose.world_from_body;
  const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  for (const double coordinate_m : {p.x, p.y, p.z}) {
    require(std::abs(coordinate_m) <= protocol::kMaxPositionM, "positions are within the limit");
  }
  require(std::abs(norm - 1.0) < 1e-9, "attitudes are unit quaternions");
}

inline void require_sound(const protocol::HostFrameData& frame) {
  require(std::abs(frame.sim_time_ns) <= protocol::kMaxSimTimeNs, "sim times are within the limit");
  require(frame.entity_count <= protocol::kMaxEntitiesPerFrame, "entities fit");
  require_sound(frame.seeker);
  for (const auto& entity : frame.entity_span()) {
    if (entity.has_pose) require_sound(entity.pose);
  }
  if (frame.fov_h_rad) {
    require(*frame.fov_h_rad > 0.0 && *frame.fov_h_rad < 3.0, "fields of view are within limits");
  }
  if (frame.gimbal_rad) {
    const glm::dvec3& g = *frame.gimbal_rad;
    for (const double angle_rad : {g.x, g.y, g.z}) {
      require(std::abs(angle_rad) <= physics::kPi, "gimbals turn by half a turn at most");
    }
  }
  if (frame.environment) {
    require(std::isfinite(frame.environment->air_k), "the weather is made of numbers");
  }
}

}  // namespace emit::fuzz
