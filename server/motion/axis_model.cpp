// SPDX-License-Identifier: Apache-2.0
#include "motion/axis_model.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

/// Steps of the integration within one step of the caller, for each radian of the servo's phase.
constexpr double kStepsPerRadian = 20.0;

/// Returns a number between two commands, with `share` 0 at `a` and 1 at `b`.
AxisMotion between(const AxisMotion& a, const AxisMotion& b, double share) noexcept {
  const auto mix = [share](double x, double y) { return x + share * (y - x); };
  return {mix(a.angle_rad, b.angle_rad), mix(a.rate_rad_s, b.rate_rad_s),
          mix(a.acceleration_rad_s2, b.acceleration_rad_s2)};
}

}  // namespace

physics::Result<AxisModel> AxisModel::create(const AxisDynamics& dynamics, double step_s,
                                             std::uint64_t seed) {
  if (auto limits = AxisProfile::create(dynamics.limits); !limits) {
    return tl::unexpected(std::move(limits.error()));
  }
  const double delay_steps = std::round(dynamics.delay_s / step_s);
  if (!(dynamics.natural_rad_s > 0.0 && dynamics.natural_rad_s <= 1e5) ||
      !(dynamics.damping > 0.0 && dynamics.damping <= 10.0) || !(step_s > 0.0) ||
      !(delay_steps >= 0.0 && delay_steps <= static_cast<double>(kMaxDelaySteps)) ||
      !(dynamics.noise_rad >= 0.0) || !(dynamics.resolution_rad >= 0.0)) {
    return physics::make_error(
        physics::ErrorCode::invalid_argument,
        "an axis needs a frequency above 0 and up to 1e5 rad/s, a damping above 0 and up to 10, a "
        "delay of at most 255 steps, and no negative noise or resolution");
  }
  return AxisModel(dynamics, step_s, static_cast<std::size_t>(delay_steps), seed);
}

void AxisModel::start(double angle_rad) noexcept {
  motion_ = {std::clamp(angle_rad, dynamics_.limits.min_rad, dynamics_.limits.max_rad), 0.0, 0.0};
  commands_.fill(motion_);
  in_effect_ = motion_;
}

double AxisModel::acceleration(const AxisMotion& command, double angle_rad,
                               double rate_rad_s) const noexcept {
  const double limit = dynamics_.limits.acceleration_rad_s2;
  const double w = dynamics_.natural_rad_s;
  // Brake by friction when the motor is off, with a tenth of what the motor could do.
  const bool off = !powered_ || fault_ == AxisFault::stuck;
  if (!off && fault_ == AxisFault::runaway) return limit;
  const double wanted = off ? -w * rate_rad_s
                            : w * w * (command.angle_rad - angle_rad) +
                                  2.0 * dynamics_.damping * w * (command.rate_rad_s - rate_rad_s) +
                                  command.acceleration_rad_s2;
  const double most = off ? 0.1 * limit : limit;
  return std::clamp(wanted, -most, most);
}

const AxisMotion& AxisModel::step(const AxisMotion& command) noexcept {
  // Take the command that is as old as the delay.
  commands_[next_] = command;
  const AxisMotion before = in_effect_;
  in_effect_ = commands_[(next_ + commands_.size() - delay_steps_) % commands_.size()];
  next_ = (next_ + 1) % commands_.size();
  // Integrate by the midpoint rule, in steps that are short against the servo's period.
  const double count = std::ceil(kStepsPerRadian * dynamics_.natural_rad_s * step_s_);
  const double part_s = step_s_ / count;
  const AxisLimits& limits = dynamics_.limits;
  for (double i = 0.0; i < count; i += 1.0) {
    const AxisMotion now = between(before, in_effect_, i / count);
    const AxisMotion middle = between(before, in_effect_, (i + 0.5) / count);
    const double first = acceleration(now, motion_.angle_rad, motion_.rate_rad_s);
    const double middle_rate = motion_.rate_rad_s + 0.5 * part_s * first;
    const double second =
        acceleration(middle, motion_.angle_rad + 0.5 * part_s * motion_.rate_rad_s, middle_rate);
    const double rate =
        std::clamp(motion_.rate_rad_s + part_s * second, -limits.rate_rad_s, limits.rate_rad_s);
    motion_.acceleration_rad_s2 = (rate - motion_.rate_rad_s) / part_s;
    motion_.angle_rad += 0.5 * part_s * (motion_.rate_rad_s + rate);
    motion_.rate_rad_s = rate;
    // Stop at the end of the travel.
    const double inside = std::clamp(motion_.angle_rad, limits.min_rad, limits.max_rad);
    if (inside != motion_.angle_rad) motion_ = {inside, 0.0, 0.0};
  }
  return motion_;
}

double AxisModel::normal() noexcept {
  // SplitMix64, and the sum of twelve uniform numbers: its tails end at six standard deviations.
  double sum = -6.0;
  for (int i = 0; i < 12; ++i) {
    random_ += 0x9e3779b97f4a7c15U;
    std::uint64_t z = random_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    sum += static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1p-53;
  }
  return sum;
}

AxisMotion AxisModel::measure() noexcept {
  AxisMotion out = motion_;
  if (dynamics_.noise_rad > 0.0) out.angle_rad += dynamics_.noise_rad * normal();
  if (dynamics_.resolution_rad > 0.0) {
    out.angle_rad = dynamics_.resolution_rad * std::round(out.angle_rad / dynamics_.resolution_rad);
  }
  return out;
}

}  // namespace emit::server
