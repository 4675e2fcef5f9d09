// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/frames.hpp"

namespace emit::renderer {

/// Pose of an entity at the instant for which the views of its samples were found, and the radius
/// of its geometry around the origin of its body.
struct EntityAnchor {
  physics::Pose pose;
  double radius_m = 1.0;
};

/// Attitude of an entity at an instant, and how far its samples' views of the scene are out of
/// date.
struct EntityStand {
  /// Unit vector to the zenith in the body frame; of a mean stand, the mean by moved_frac.
  glm::vec3 up_body{0.0F, 0.0F, 1.0F};
  /// 0: the entity stands as it did at its anchor, and the views found there hold. 1: nothing but
  /// its own hull is as it was seen.
  float moved_frac = 0.0F;

  /// Adds another stand to a sum of stands with weights that sum up to 1. The share of the sky is
  /// linear in the zenith (view_of_now.hpp), so that the sum gives the mean share.
  /// @pre the sum began with zeros
  void add(const EntityStand& other, float weight_frac) noexcept {
    const float part = weight_frac * other.moved_frac;
    if (!(part > 0.0F)) return;
    up_body = (moved_frac * up_body + part * other.up_body) / (moved_frac + part);
    moved_frac += part;
  }
};

/// Turn from the anchor at which the views found there no longer count, rad.
inline constexpr double kStandTurnRad = 0.1;

/// Returns the stand of an entity with the pose `now`. moved_frac grows linearly with the turn, up
/// to 1 at kStandTurnRad, and with the way from the anchor, up to 1 at the radius; the greater one
/// counts. RT-safe.
[[nodiscard]] inline EntityStand stand_of(const physics::Pose& now,
                                          const EntityAnchor& anchor) noexcept {
  const glm::dvec3 up_body = glm::conjugate(now.world_from_body) * glm::dvec3(0.0, 0.0, 1.0);
  // Take the angle from the vector part: the scalar part does not resolve small turns.
  const glm::dquat turn = glm::conjugate(anchor.pose.world_from_body) * now.world_from_body;
  const double sine = glm::length(glm::dvec3(turn.x, turn.y, turn.z));
  const double angle_rad = 2.0 * std::asin(std::min(sine, 1.0));
  const double way_m = glm::distance(now.position_world_m, anchor.pose.position_world_m);
  const double moved = std::max(angle_rad / kStandTurnRad, way_m / std::max(anchor.radius_m, 0.01));
  return {glm::vec3(up_body), static_cast<float>(std::min(moved, 1.0))};
}

}  // namespace emit::renderer
