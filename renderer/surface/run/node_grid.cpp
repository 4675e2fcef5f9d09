// SPDX-License-Identifier: Apache-2.0
#include "surface/run/node_grid.hpp"

#include <algorithm>

namespace emit::renderer {

std::int64_t NodeGrid::at_or_before_ns(std::int64_t now_ns) const noexcept {
  return start_ns_ + std::max<std::int64_t>(0, now_ns - start_ns_) / interval_ns_ * interval_ns_;
}

std::int64_t NodeGrid::next_ns(std::int64_t from_ns, std::int64_t now_ns,
                               const WorldInputs& inputs) const noexcept {
  // Take the next instant of the grid, or the one after it if that is too close.
  const std::int64_t into_ns = (from_ns - start_ns_) % interval_ns_;
  std::int64_t next_ns = from_ns + interval_ns_ - into_ns;
  now_ns = std::clamp(now_ns, from_ns, next_ns);
  if (next_ns - now_ns < interval_ns_ / 4) next_ns += interval_ns_;
  // Cut the interval at the first event that is known in advance. The fraction of an interval
  // keeps many events from making many intervals.
  constexpr std::int64_t kSameFraction = 16;
  const std::int64_t first_ns = now_ns + std::max(kSameNs, interval_ns_ / kSameFraction);
  const auto cut = [&](std::span<const std::int64_t> instants_ns) {
    const auto after = std::ranges::lower_bound(instants_ns, first_ns);
    if (after != instants_ns.end()) next_ns = std::min(next_ns, *after);
  };
  for (const PoseHistory& entity : inputs.entities) cut(entity.events_ns());
  cut(inputs.environment.changes_ns());
  // A part that changes before its event takes short steps already (LocalSteps).
  for (const PartHistory& part : inputs.parts) {
    const std::span<const std::int64_t> events_ns = part.events_ns();
    for (auto event = std::ranges::lower_bound(events_ns, first_ns);
         event != events_ns.end() && *event < next_ns; ++event) {
      if (!part.changes(*event - interval_ns_, *event - 1)) next_ns = *event;
    }
  }
  return next_ns;
}

}  // namespace emit::renderer
