// SPDX-License-Identifier: Apache-2.0
#include "motion/axis_blend.hpp"

#include "emit/physics/check.hpp"

namespace emit::server {

void AxisBlend::start(const AxisMotion& difference, double span_s) noexcept {
  EMIT_DCHECK_OP(span_s, >, 0.0);
  difference_ = difference;
  span_s_ = span_s;
}

AxisMotion AxisBlend::at(double after_s) const noexcept {
  EMIT_DCHECK_OP(after_s, >=, 0.0);
  if (after_s >= span_s_) return {};
  // The Hermite polynomials of fifth degree for value, slope and curvature at 0. All three vanish
  // at 1.
  const double s = after_s / span_s_;
  const double s2 = s * s;
  const double s3 = s2 * s;
  const double s4 = s3 * s;
  const double s5 = s4 * s;
  const double value = difference_.angle_rad;
  const double slope = difference_.rate_rad_s * span_s_;
  const double curvature = difference_.acceleration_rad_s2 * span_s_ * span_s_;
  AxisMotion out;
  out.angle_rad = value * (1.0 - 10.0 * s3 + 15.0 * s4 - 6.0 * s5) +
                  slope * (s - 6.0 * s3 + 8.0 * s4 - 3.0 * s5) +
                  curvature * (0.5 * s2 - 1.5 * s3 + 1.5 * s4 - 0.5 * s5);
  out.rate_rad_s = (value * (-30.0 * s2 + 60.0 * s3 - 30.0 * s4) +
                    slope * (1.0 - 18.0 * s2 + 32.0 * s3 - 15.0 * s4) +
                    curvature * (s - 4.5 * s2 + 6.0 * s3 - 2.5 * s4)) /
                   span_s_;
  out.acceleration_rad_s2 =
      (value * (-60.0 * s + 180.0 * s2 - 120.0 * s3) + slope * (-36.0 * s + 96.0 * s2 - 60.0 * s3) +
       curvature * (1.0 - 9.0 * s + 18.0 * s2 - 10.0 * s3)) /
      (span_s_ * span_s_);
  return out;
}

}  // namespace emit::server
