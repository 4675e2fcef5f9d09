// SPDX-License-Identifier: Apache-2.0
#include "history/step_plan.hpp"

#include <algorithm>
#include <cstdlib>

#include "emit/physics/step_nodes.hpp"

namespace emit::renderer {

StepPlan::StepPlan(const scene::ThermalOptions& options)
    : options_(options),
      nodes_ns_(options.steps + 1),
      snapped_(options.steps + 1),
      intervals_(options.steps) {}

void StepPlan::snap_to(std::span<const std::int64_t> events_ns) noexcept {
  const std::size_t last = nodes_ns_.size() - 1;
  // The newest events matter most, so they choose their nodes first.
  for (auto event = events_ns.rbegin(); event != events_ns.rend(); ++event) {
    if (*event >= nodes_ns_.back()) continue;
    if (*event <= nodes_ns_.front()) break;
    const auto above = std::lower_bound(nodes_ns_.begin(), nodes_ns_.end(), *event);
    if (*above == *event) continue;
    std::size_t best = 0;
    for (const auto candidate : {above - 1, above}) {
      const auto i = static_cast<std::size_t>(candidate - nodes_ns_.begin());
      if (i == 0 || i == last || snapped_[i]) continue;
      if (best == 0 || std::abs(nodes_ns_[i] - *event) < std::abs(nodes_ns_[best] - *event)) {
        best = i;
      }
    }
    if (best == 0) continue;
    nodes_ns_[best] = *event;
    snapped_[best] = true;
  }
}

void StepPlan::update(std::int64_t now_ns, const Environment& environment,
                      std::span<const PoseHistory> entities,
                      std::span<const PartHistory> parts) noexcept {
  if (options_.spacing == scene::StepSpacing::uniform) {
    physics::uniform_step_nodes(options_.history_start_ns, now_ns, nodes_ns_);
  } else {
    physics::geometric_step_nodes(options_.history_start_ns, now_ns, options_.first_step_s,
                                  nodes_ns_);
  }
  std::fill(snapped_.begin(), snapped_.end(), false);
  for (const PoseHistory& entity : entities) snap_to(entity.events_ns());
  snap_to(environment.changes_ns());
  for (const PartHistory& part : parts) snap_to(part.events_ns());

  physics::SunPosition sun = environment.sun_at(nodes_ns_.front());
  physics::Forcing forcing = environment.forcing_at(nodes_ns_.front(), sun);
  for (std::size_t i = 0; i < intervals_.size(); ++i) {
    HistoryInterval& interval = intervals_[i];
    interval.begin_ns = nodes_ns_[i];
    interval.end_ns = nodes_ns_[i + 1];
    interval.sun_begin = sun;
    interval.forcing_begin = forcing;
    sun = environment.sun_at(interval.end_ns);
    forcing = environment.forcing_at(interval.end_ns, sun);
    interval.sun_end = sun;
    // Weather that changes at the end of the interval has not acted in it.
    interval.forcing_end = interval.end_ns > interval.begin_ns
                               ? environment.forcing_at(interval.end_ns - 1, sun)
                               : forcing;

    interval.rain_mm = environment.rain_mm(interval.begin_ns, interval.end_ns);
    interval.sample_ns = interval.begin_ns + (interval.end_ns - interval.begin_ns) / 2;
    interval.sun_sample = environment.sun_at(interval.sample_ns);
    if (interval.sun_sample.elevation.value() <= kMinSunElevationRad) {
      // The sun rises or sets within the interval, so the lit end represents it.
      const bool rising = interval.sun_end.elevation.value() > interval.sun_begin.elevation.value();
      interval.sample_ns = rising ? interval.end_ns : interval.begin_ns;
      interval.sun_sample = rising ? interval.sun_end : interval.sun_begin;
    }
    interval.sun_up = interval.sun_sample.elevation.value() > kMinSunElevationRad &&
                      std::max(interval.forcing_begin.direct_normal_w_m2,
                               interval.forcing_end.direct_normal_w_m2) > 0.0;
  }
  sun_now_ = sun;
  forcing_now_ = forcing;
}

}  // namespace emit::renderer
