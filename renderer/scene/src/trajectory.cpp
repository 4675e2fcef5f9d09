// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/trajectory.hpp"

#include <algorithm>

#include "emit/physics/check.hpp"

namespace emit::scene {

TrajectoryState trajectory_at(const Trajectory& keyframes, std::int64_t sim_time_ns) noexcept {
  EMIT_DCHECK(!keyframes.empty());
  EMIT_DCHECK(std::ranges::is_sorted(keyframes, {}, &Keyframe::sim_time_ns));
  const auto after = std::upper_bound(
      keyframes.begin(), keyframes.end(), sim_time_ns,
      [](std::int64_t time_ns, const Keyframe& key) { return time_ns < key.sim_time_ns; });
  if (after == keyframes.begin()) return {keyframes.front().pose, keyframes.front().on};
  const Keyframe& before = *(after - 1);
  if (after == keyframes.end() || after->teleport) return {before.pose, before.on};
  const double fraction = static_cast<double>(sim_time_ns - before.sim_time_ns) /
                          static_cast<double>(after->sim_time_ns - before.sim_time_ns);
  return {physics::interpolate(before.pose, after->pose, fraction), before.on};
}

}  // namespace emit::scene
