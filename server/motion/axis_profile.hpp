// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <limits>

#include "emit/physics/error.hpp"
#include "motion/gimbal.hpp"

namespace emit::server {

/// Travel, rate and acceleration of which an axis of a motion simulator is capable.
struct AxisLimits {
  double min_rad = -std::numeric_limits<double>::infinity();  ///< infinite: the axis turns freely
  double max_rad = std::numeric_limits<double>::infinity();
  double rate_rad_s = 1.0;            ///< greatest rate, both ways
  double acceleration_rad_s2 = 10.0;  ///< greatest acceleration, both ways
};

/// Commands of one axis that never leave its limits. They follow a demand exactly as long as it
/// stays within the limits and its acceleration is constant over a step. Else they approach it
/// without overshoot, and brake with four fifths of the acceleration. With a demand at rest they
/// drive an axis to its place at start and to its park position.
///
/// RT-safe after create().
class AxisProfile {
 public:
  /// Command for the end of a step, and the limits that kept it from the demand.
  struct Command {
    AxisMotion motion;
    AxisMotion wanted;            ///< the demand, or the end of the travel next to it
    bool travel_limited = false;  ///< the demand is outside of the travel
    bool rate_limited = false;
    bool acceleration_limited = false;
    [[nodiscard]] bool limited() const noexcept {
      return travel_limited || rate_limited || acceleration_limited;
    }
  };

  /// Errors: invalid_argument (no travel, or a rate or an acceleration that is not positive).
  [[nodiscard]] static physics::Result<AxisProfile> create(const AxisLimits& limits);

  /// Places the axis at an angle, with a rate. Values beyond the limits count as the limits.
  void start(double angle_rad, double rate_rad_s = 0.0) noexcept;

  /// Returns the command for `step_s` later, at which `demand` is to be met. `share` is the part of
  /// the greatest rate and acceleration that is used: small ones start and park softly. To stop
  /// before the end of its travel the axis uses more.
  /// @pre step_s > 0, share in (0, 1]
  Command step(const AxisMotion& demand, double step_s, double share = 1.0) noexcept;

  [[nodiscard]] const AxisMotion& motion() const noexcept { return motion_; }

 private:
  explicit AxisProfile(const AxisLimits& limits) : limits_(limits) {}

  AxisLimits limits_;
  AxisMotion motion_;
};

}  // namespace emit::server
