// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <optional>

#include "motion/table_follower.hpp"

namespace emit::server {

/// Motion simulator as the agents use it.
struct MotionPlan {
  explicit MotionPlan(const MotionTable& table) : follower(table) {}

  TableFollower::Options follower;
  std::optional<std::uint32_t> target_entity;  ///< that the target rings point to
  /// True if the images are projected: they are rendered along the projector, because the table
  /// turns the seeker already. False: they are rendered along the seeker.
  bool projects = false;
  double focal_px = 1.0;    ///< focal length of the image
  glm::dvec2 size_px{1.0};  ///< of the whole image
};

}  // namespace emit::server
