// SPDX-License-Identifier: Apache-2.0
#include "motion/axis_profile.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Share of a lag that a step makes up for, as long as no limit is reached.
constexpr double kGainPerStep = 0.25;
/// Share of the acceleration that is planned for braking to the demand. The rest is for its own
/// acceleration and for the length of a step.
constexpr double kBrakingShare = 0.8;
/// Differences below this count as none when a limit is reported, in units of the limit.
constexpr double kNone = 1e-9;

/// Returns the rate at which a lag is made up for: in proportion to it when it is small, else the
/// greatest from which the axis can brake in time, sqrt(2 a lag).
double closing_rate(double lag_rad, double braking_rad_s2, double gain_per_s) noexcept {
  const double small_rad = braking_rad_s2 / (gain_per_s * gain_per_s);
  const double size_rad = std::abs(lag_rad);
  if (size_rad <= small_rad) return gain_per_s * lag_rad;
  return std::copysign(std::sqrt(2.0 * braking_rad_s2 * (size_rad - 0.5 * small_rad)), lag_rad);
}

/// Returns the way that a step may add to the shortest way to stop: a fraction of the last step, in
/// which the axis could stop, is not there.
double stopping_margin_rad(double acceleration_rad_s2, double step_s) noexcept {
  return 0.125 * acceleration_rad_s2 * step_s * step_s;
}

/// Returns the greatest rate at the end of a step from which the axis can stop within `left_rad` of
/// where the step begins, less the margin. It solves (rate + out) step / 2 + out^2 / (2 a) = left.
double stopping_rate(double left_rad, double rate_rad_s, double margin_rad,
                     double acceleration_rad_s2, double step_s) noexcept {
  if (std::isinf(left_rad)) return left_rad;
  const double free_rad = left_rad - margin_rad - 0.5 * rate_rad_s * step_s;
  const double root2 = 0.25 * step_s * step_s + 2.0 * free_rad / acceleration_rad_s2;
  return acceleration_rad_s2 * (std::sqrt(std::max(root2, 0.0)) - 0.5 * step_s);
}

}  // namespace

physics::Result<AxisProfile> AxisProfile::create(const AxisLimits& limits) {
  if (!(limits.min_rad < limits.max_rad) || !(limits.rate_rad_s > 0.0) ||
      !(limits.acceleration_rad_s2 > 0.0) || std::isinf(limits.rate_rad_s) ||
      std::isinf(limits.acceleration_rad_s2)) {
    return physics::make_error(
        physics::ErrorCode::invalid_argument,
        "the limits of an axis need a travel, a positive rate and a positive acceleration");
  }
  return AxisProfile(limits);
}

void AxisProfile::start(double angle_rad, double rate_rad_s) noexcept {
  motion_ = {std::clamp(angle_rad, limits_.min_rad, limits_.max_rad),
             std::clamp(rate_rad_s, -limits_.rate_rad_s, limits_.rate_rad_s), 0.0};
}

AxisProfile::Command AxisProfile::step(const AxisMotion& demand, double step_s,
                                       double share) noexcept {
  EMIT_DCHECK_OP(step_s, >, 0.0);
  EMIT_DCHECK(share > 0.0 && share <= 1.0);
  const double rate_limit = share * limits_.rate_rad_s;
  const double acceleration_limit = share * limits_.acceleration_rad_s2;
  Command out;
  // Let a demand outside of the travel rest at its end.
  AxisMotion wanted = demand;
  wanted.angle_rad = std::clamp(demand.angle_rad, limits_.min_rad, limits_.max_rad);
  if (wanted.angle_rad != demand.angle_rad) {
    out.travel_limited = true;
    wanted.rate_rad_s = wanted.acceleration_rad_s2 = 0.0;
  }
  // Keep so far from the ends that the axis can stop there.
  const double margin_rad = std::min(stopping_margin_rad(limits_.acceleration_rad_s2, step_s),
                                     0.5 * (limits_.max_rad - limits_.min_rad));
  wanted.angle_rad =
      std::clamp(wanted.angle_rad, limits_.min_rad + margin_rad, limits_.max_rad - margin_rad);
  out.wanted = wanted;
  // Find how far the axis would miss the demand with the demand's own acceleration.
  const double ahead =
      std::clamp(wanted.acceleration_rad_s2, -acceleration_limit, acceleration_limit);
  const double lag_rad =
      wanted.angle_rad - motion_.angle_rad - (motion_.rate_rad_s + 0.5 * ahead * step_s) * step_s;
  // Choose the rate at the end of the step that closes the gap.
  const double braking = std::max(kBrakingShare * acceleration_limit - std::abs(ahead),
                                  (1.0 - kBrakingShare) * acceleration_limit);
  const double wanted_rate =
      wanted.rate_rad_s + closing_rate(lag_rad, braking, kGainPerStep / step_s);
  // Keep to the rate, to what stops before the ends of the travel, and to the acceleration.
  const auto stopping = [&](double rate, double acceleration) {
    const double up = stopping_rate(limits_.max_rad - motion_.angle_rad, motion_.rate_rad_s,
                                    margin_rad, acceleration, step_s);
    const double down = stopping_rate(motion_.angle_rad - limits_.min_rad, -motion_.rate_rad_s,
                                      margin_rad, acceleration, step_s);
    return std::max(std::min(rate, up), -down);
  };
  double rate = std::clamp(wanted_rate, -rate_limit, rate_limit);
  out.rate_limited = std::abs(rate - wanted_rate) > kNone * rate_limit;
  rate = stopping(rate, acceleration_limit);
  double within = std::clamp(rate, motion_.rate_rad_s - acceleration_limit * step_s,
                             motion_.rate_rad_s + acceleration_limit * step_s);
  out.acceleration_limited = std::abs(within - rate) > kNone * acceleration_limit * step_s;
  // Stop before the ends with all that the axis has: it may have come with more than its share now.
  within = std::clamp(stopping(within, limits_.acceleration_rad_s2),
                      motion_.rate_rad_s - limits_.acceleration_rad_s2 * step_s,
                      motion_.rate_rad_s + limits_.acceleration_rad_s2 * step_s);
  motion_.acceleration_rad_s2 = (within - motion_.rate_rad_s) / step_s;
  motion_.angle_rad += 0.5 * (motion_.rate_rad_s + within) * step_s;
  motion_.rate_rad_s = within;
  out.motion = motion_;
  return out;
}

}  // namespace emit::server
