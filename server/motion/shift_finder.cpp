// SPDX-License-Identifier: Apache-2.0
#include "motion/shift_finder.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace emit::server {

glm::dvec2 image_shift_px(const MotionPlan& plan, const ShownAttitude& shown,
                          const TableAngles& angles) noexcept {
  const glm::dmat3 world_from_shown =
      plan.follower.table.world_from_projector(shown.world_from_seeker, angles);
  // Axes so far from where they were expected are no matter of a shift.
  constexpr double kLeastCosine = 0.9;
  if (glm::dot(shown.world_from_rendered[0], world_from_shown[0]) < kLeastCosine ||
      glm::dot(shown.world_from_rendered[1], world_from_shown[1]) < kLeastCosine) {
    return glm::dvec2(std::numeric_limits<double>::quiet_NaN());
  }
  return image_shift(shown.world_from_rendered, world_from_shown, plan.size_px, plan.focal_px)
      .shift_px;
}

void ShiftFinder::add(const AxisFeedback& feedback) noexcept {
  if (!track_.add(feedback)) {
    track_.clear();
    static_cast<void>(track_.add(feedback));
  }
}

std::optional<glm::dvec2> ShiftFinder::shift_px(const ShownAttitude& shown,
                                                std::int64_t display_ns) const noexcept {
  const auto state = track_.at(display_ns, plan_.follower.horizon_ns);
  if (!state) return std::nullopt;
  const glm::dvec2 shift_px = image_shift_px(plan_, shown, state->angles);
  if (!std::isfinite(shift_px.x + shift_px.y)) return std::nullopt;
  return shift_px;
}

}  // namespace emit::server
