// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "motion/feedback_track.hpp"
#include "motion/motion_plan.hpp"

namespace emit::server {

/// Returns the shift of the centre of a finished image to where the axes are, px, right and down.
/// It is not a number for axes so far from where they were expected that no shift mends it.
/// RT-safe.
[[nodiscard]] glm::dvec2 image_shift_px(const MotionPlan& plan, const ShownAttitude& shown,
                                        const TableAngles& angles) noexcept;

/// Finds the shift of finished images by the latest measurements of the axes.
///
/// Thread: one owner. Fixed size. RT-safe.
class ShiftFinder {
 public:
  /// The plan outlives the object.
  explicit ShiftFinder(const MotionPlan& plan) : plan_(plan) {}

  /// Takes a measurement. One that is not later than those before begins anew: the controller was
  /// started again, or its clock was set.
  void add(const AxisFeedback& feedback) noexcept;
  /// Returns the shift of an image that is shown at `display_ns`, wall; nothing where no
  /// measurement is near that instant.
  [[nodiscard]] std::optional<glm::dvec2> shift_px(const ShownAttitude& shown,
                                                   std::int64_t display_ns) const noexcept;

 private:
  const MotionPlan& plan_;
  FeedbackTrack track_;
};

}  // namespace emit::server
