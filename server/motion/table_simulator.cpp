// SPDX-License-Identifier: Apache-2.0
#include "motion/table_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

using protocol::AxesMode;
using protocol::AxesState;

/// A demand is extrapolated at most this far from its instant.
constexpr double kLongestExtrapolationS = 0.05;
/// Differences from the demand below which an axis has captured it, or has parked.
constexpr double kCapturedRad = 1e-4;
constexpr double kCapturedRadS = 1e-2;
/// Time over which a soft start grows to all that the axes have.
constexpr double kCaptureS = 3.0;

}  // namespace

physics::Result<TableSimulator> TableSimulator::create(const Options& options) {
  if (options.axes.empty() || options.axes.size() > protocol::kMaxAxes) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "a motion simulator has one to five axes");
  }
  std::vector<AxisProfile> profiles;
  std::vector<AxisModel> models;
  for (const Axis& axis : options.axes) {
    auto profile = AxisProfile::create(axis.dynamics.limits);
    if (!profile) return tl::unexpected(std::move(profile.error()));
    auto model = AxisModel::create(axis.dynamics, 1e-9 * static_cast<double>(options.step_ns),
                                   options.seed + models.size());
    if (!model) return tl::unexpected(std::move(model.error()));
    const AxisLimits& limits = axis.dynamics.limits;
    if (!(axis.park_rad >= limits.min_rad && axis.park_rad <= limits.max_rad)) {
      return physics::make_error(physics::ErrorCode::invalid_argument,
                                 "the park position of an axis is outside of its travel");
    }
    profile->start(axis.park_rad);
    model->start(axis.park_rad);
    profiles.push_back(*profile);
    models.push_back(*model);
  }
  return TableSimulator(options, std::move(profiles), std::move(models));
}

TableSimulator::TableSimulator(const Options& options, std::vector<AxisProfile> profiles,
                               std::vector<AxisModel> models) noexcept
    : options_(options), profiles_(std::move(profiles)), models_(std::move(models)) {
  monitor_.count = models_.size();
}

bool TableSimulator::take(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept {
  // A host that was started anew may begin at any counter once the one before it is silent.
  if (command.counter <= command_.counter && !silent(now_ns)) return false;
  if (command.mode == AxesMode::follow && command.count != models_.size()) return false;
  command_ = command;
  command_ns_ = now_ns;
  off_ = off_ || command.mode == AxesMode::off;
  return true;
}

bool TableSimulator::silent(std::int64_t now_ns) const noexcept {
  return now_ns - command_ns_ > std::int64_t{command_.timeout_ms} * 1'000'000;
}

void TableSimulator::set_fault(std::size_t axis, AxisFault fault) noexcept {
  EMIT_CHECK_OP(axis, <, models_.size());
  models_[axis].set_fault(fault);
}

void TableSimulator::choose_state(std::int64_t now_ns) noexcept {
  AxesState& state = monitor_.state;
  monitor_.command_counter = command_.counter;
  // The interlock stays open until the host has switched the motors off.
  const bool was_off = std::exchange(off_, false);
  if (state == AxesState::fault && !was_off) return;
  if (was_off || command_.counter == 0 || command_.mode == AxesMode::off) {
    state = AxesState::motors_off;
    monitor_.faulty_axes = 0;
    monitor_.timed_out = false;
    return;
  }
  monitor_.timed_out = silent(now_ns);
  const bool follow = command_.mode == AxesMode::follow && !monitor_.timed_out;
  const bool followed = state == AxesState::following || state == AxesState::capturing;
  // Begin commands where the axes are when the motors are back on.
  if (state == AxesState::motors_off) {
    for (std::size_t i = 0; i < models_.size(); ++i) {
      profiles_[i].start(models_[i].motion().angle_rad);
    }
  }
  if (follow && !followed) {
    state = AxesState::capturing;
    capture_ns_ = now_ns;
  }
  if (!follow && state != AxesState::parked) state = AxesState::parking;
}

double TableSimulator::share(std::int64_t now_ns) const noexcept {
  if (monitor_.state == AxesState::following) return 1.0;
  if (monitor_.state != AxesState::capturing) return options_.soft_share;
  // Grow to all that the axes have, so that fast demands are captured too.
  const double grown = std::min(1.0, 1e-9 * static_cast<double>(now_ns - capture_ns_) / kCaptureS);
  return options_.soft_share + (1.0 - options_.soft_share) * grown;
}

AxisMotion TableSimulator::demand(std::size_t axis, std::int64_t now_ns) const noexcept {
  if (monitor_.state == AxesState::parking || monitor_.state == AxesState::parked) {
    return {options_.axes[axis].park_rad, 0.0, 0.0};
  }
  // Take the demand to the instant of this step, along its own rate and acceleration.
  const AxisMotion& at = command_.axes[axis];
  const double ahead_s =
      1e-9 * (static_cast<double>(now_ns) - static_cast<double>(command_.time_ns));
  const double taken_s = std::clamp(ahead_s, -kLongestExtrapolationS, kLongestExtrapolationS);
  const double angle_rad =
      at.angle_rad + (at.rate_rad_s + 0.5 * at.acceleration_rad_s2 * taken_s) * taken_s;
  // Rest where the extrapolation ends.
  if (taken_s != ahead_s) return {angle_rad, 0.0, 0.0};
  return {angle_rad, at.rate_rad_s + at.acceleration_rad_s2 * taken_s, at.acceleration_rad_s2};
}

const protocol::AxesMonitor& TableSimulator::step(std::int64_t now_ns) noexcept {
  choose_state(now_ns);
  AxesState& state = monitor_.state;
  const bool powered = state != AxesState::motors_off && state != AxesState::fault;
  const double step_s = 1e-9 * static_cast<double>(options_.step_ns);
  const double share = this->share(now_ns);
  bool arrived = powered;
  monitor_.limited_axes = 0;
  for (std::size_t i = 0; i < models_.size(); ++i) {
    AxisModel& model = models_[i];
    model.set_powered(powered);
    if (!powered) {
      profiles_[i].start(model.motion().angle_rad);
      model.step(profiles_[i].motion());
    } else {
      const AxisProfile::Command command = profiles_[i].step(demand(i, now_ns), step_s, share);
      model.step(command.motion);
      if (command.limited()) monitor_.limited_axes |= 1U << i;
      arrived = arrived &&
                std::abs(command.motion.angle_rad - command.wanted.angle_rad) < kCapturedRad &&
                std::abs(command.motion.rate_rad_s - command.wanted.rate_rad_s) < kCapturedRadS;
      if (std::abs(model.motion().angle_rad - command.motion.angle_rad) > options_.most_error_rad) {
        monitor_.faulty_axes |= 1U << i;
      }
    }
    monitor_.measured[i] = model.measure();
    monitor_.demanded[i] = profiles_[i].motion();
  }
  if (powered && monitor_.faulty_axes != 0) {
    state = AxesState::fault;
  } else if (arrived && state == AxesState::capturing) {
    state = AxesState::following;
  } else if (arrived && state == AxesState::parking) {
    state = AxesState::parked;
  }
  ++monitor_.counter;
  monitor_.time_ns = now_ns;
  return monitor_;
}

}  // namespace emit::server
