// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "motion/gimbal.hpp"

namespace emit::server {

/// Difference between the course of an axis that was predicted before and the one predicted now,
/// which fades to nothing. The new course plus the difference begins with the angle, the rate and
/// the acceleration of the old one: a quintic polynomial joins them.
///
/// RT-safe.
class AxisBlend {
 public:
  /// Begins with a difference, which is gone `span_s` later.
  /// @pre span_s > 0
  void start(const AxisMotion& difference, double span_s) noexcept;
  /// Returns the difference that is left `after_s` later.
  /// @pre after_s >= 0
  [[nodiscard]] AxisMotion at(double after_s) const noexcept;
  void clear() noexcept { *this = {}; }

 private:
  AxisMotion difference_;
  double span_s_ = 0.0;  ///< 0: there is no difference
};

}  // namespace emit::server
