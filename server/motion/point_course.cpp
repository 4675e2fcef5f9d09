// SPDX-License-Identifier: Apache-2.0
#include "motion/point_course.hpp"

namespace emit::server {
namespace {

double span_s(const TimedPoint& from, const TimedPoint& to) noexcept {
  return 1e-9 * static_cast<double>(to.sim_time_ns - from.sim_time_ns);
}

glm::dvec3 mean_velocity_m_s(const TimedPoint& from, const TimedPoint& to) noexcept {
  return (to.position_m - from.position_m) / span_s(from, to);
}

}  // namespace

Parabola parabola(const glm::dvec3& first_mean, double first_s, const glm::dvec3& last_mean,
                  double last_s) noexcept {
  EMIT_DCHECK(first_s > 0.0 && last_s > 0.0);
  const glm::dvec3 curvature = (last_mean - first_mean) * (2.0 / (first_s + last_s));
  return {last_mean + curvature * (0.5 * last_s), curvature};
}

void PointCourse::push(const TimedPoint& point) noexcept {
  if (count_ > 0 && !point.teleport) {
    const std::int64_t after_ns = point.sim_time_ns - points_[count_ - 1].sim_time_ns;
    if (after_ns < 0) return;
    if (after_ns == 0) {
      points_[0] = point;
      points_[0].velocity_m_s.reset();
      count_ = 1;
      return;
    }
    if (after_ns < kLeastIntervalNs) --count_;
  }
  if (point.teleport) count_ = 0;
  if (count_ == points_.size()) {
    points_[0] = points_[1];
    points_[1] = points_[2];
    --count_;
  }
  points_[count_++] = point;
}

PointCourse::State PointCourse::at(std::int64_t sim_time_ns) const noexcept {
  EMIT_DCHECK(!empty());
  const TimedPoint& last = points_[count_ - 1];
  State out;
  if (count_ >= 2) {
    const TimedPoint& before = points_[count_ - 2];
    out.velocity_m_s = mean_velocity_m_s(before, last);
    if (last.velocity_m_s && before.velocity_m_s) {
      out.acceleration_m_s2 = (*last.velocity_m_s - *before.velocity_m_s) / span_s(before, last);
    } else if (count_ == 3 && !last.velocity_m_s) {
      const TimedPoint& first = points_[0];
      const Parabola way = parabola(mean_velocity_m_s(first, before), span_s(first, before),
                                    out.velocity_m_s, span_s(before, last));
      out.velocity_m_s = way.slope;
      out.acceleration_m_s2 = way.curvature;
    }
  }
  if (last.velocity_m_s) out.velocity_m_s = *last.velocity_m_s;
  const double after_s = 1e-9 * static_cast<double>(sim_time_ns - last.sim_time_ns);
  out.position_m =
      last.position_m + after_s * (out.velocity_m_s + 0.5 * after_s * out.acceleration_m_s2);
  out.velocity_m_s += after_s * out.acceleration_m_s2;
  return out;
}

}  // namespace emit::server
