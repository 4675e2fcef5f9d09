// SPDX-License-Identifier: Apache-2.0
#include "surface/run/node_grid.hpp"

#include <algorithm>

namespace emit::renderer {

std::int64_t NodeGrid::at_or_before_ns(std::int64_t now_ns) const noexcept {
  return start_ns_ + std::max<std::int64_t>(0, now_ns - start_ns_) / interval_ns_ * interval_ns_;
}

std::int64_t NodeGrid::next_ns(std::int64_t from_ns, std::int64_t now_ns,
                               const Environment& environment,
                               std::span<const PoseHistory> entities) const noexcept {
  // Take the next instant of the grid, or the one after it if that is too close.
  const std::int64_t into_ns = (from_ns - start_ns_) % interval_ns_;
  std::int64_t next_ns = from_ns + interval_ns_ - into_ns;
  now_ns = std::clamp(now_ns, from_ns, next_ns);
  if (next_ns - now_ns < interval_ns_ / 4) next_ns += interval_ns_;
  // Cut the interval at the first event that is known in advance. The fraction of an interval
  // keeps many events from making many intervals.
  constexpr std::int64_t kSameFraction = 16;
  const auto cut = [&](std::span<const std::int64_t> instants_ns) {
    const auto after = std::ranges::lower_bound(
        instants_ns, now_ns + std::max(kSameNs, interval_ns_ / kSameFraction));
    if (after != instants_ns.end()) next_ns = std::min(next_ns, *after);
  };
  for (const PoseHistory& entity : entities) cut(entity.events_ns());
  cut(environment.changes_ns());
  return next_ns;
}

}  // namespace emit::renderer
