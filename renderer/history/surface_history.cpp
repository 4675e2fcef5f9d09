// SPDX-License-Identifier: Apache-2.0
#include "history/surface_history.hpp"

#include <algorithm>

#include "emit/physics/check.hpp"
#include "emit/physics/surface_balance.hpp"

namespace emit::renderer {
namespace {

SurfaceForcing with_environment(const physics::SunPosition& sun,
                                const physics::Forcing& weather) noexcept {
  SurfaceForcing forcing = open_forcing(sun, weather);
  forcing.environment_w_m2 = physics::environment_input_w_m2(1.0, weather.environment_k);
  return forcing;
}

}  // namespace

IntervalForcing weather_forcing(const HistoryInterval& interval) noexcept {
  return {with_environment(interval.sun_begin, interval.forcing_begin),
          with_environment(interval.sun_end, interval.forcing_end),
          static_cast<double>(interval.end_ns - interval.begin_ns) * 1e-9};
}

void SurfaceHistory::update(const StepPlan& plan, const Environment& environment) noexcept {
  if (foster_) {
    foster_->update(plan, environment);
    return;
  }
  const auto intervals = plan.intervals();
  const std::size_t count = std::min(intervals.size(), intervals_.size());
  for (std::size_t i = 0; i < count; ++i) intervals_[i] = weather_forcing(intervals[i]);
}

std::span<const IntervalForcing> SurfaceHistory::intervals() const noexcept {
  return foster_ ? foster_->intervals() : std::span<const IntervalForcing>(intervals_);
}

std::span<const IntervalForcing> SurfaceHistory::tail() const noexcept {
  return foster_ ? foster_->tail() : std::span<const IntervalForcing>();
}

IntervalForcing SurfaceHistory::extend(std::int64_t begin_ns, std::int64_t end_ns,
                                       const Environment& environment) noexcept {
  return foster_ ? foster_->extend(begin_ns, end_ns, environment)
                 : weather_forcing(interval_between(begin_ns, end_ns, environment));
}

GroundState SurfaceHistory::surroundings() const noexcept {
  return foster_ ? foster_->surroundings() : GroundState{};
}

void SurfaceHistory::restore_surroundings(const GroundState& state) noexcept {
  if (foster_) foster_->restore_surroundings(state);
}

std::optional<double> SurfaceHistory::surroundings_now_k() const noexcept {
  if (!foster_) return std::nullopt;
  return foster_->surroundings_now_k();
}

const physics::FosterNetwork& SurfaceHistory::network(std::size_t material) const noexcept {
  if (!foster_) return no_network_;
  EMIT_DCHECK_OP(material, <, foster_->materials().size());
  return foster_->materials()[material].network;
}

physics::FosterState<double> SurfaceHistory::start_states(std::size_t material,
                                                          const glm::dvec3& normal) const noexcept {
  return foster_ ? foster_->start_states(material, normal) : physics::FosterState<double>{};
}

}  // namespace emit::renderer
