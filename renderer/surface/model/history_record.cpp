// SPDX-License-Identifier: Apache-2.0
#include "surface/model/history_record.hpp"

namespace emit::renderer {

HistoryRecord make_history_record(const StepPlan& plan, const SurfaceHistory& history,
                                  const SampleHeat& heat, const Environment& environment,
                                  std::span<const PoseHistory> entities,
                                  const IntervalRays& prototype, const glm::dvec3& origin_world_m) {
  HistoryRecord record;
  const auto heat_interval = [&](const IntervalForcing& forcing) {
    HeatInterval interval = heat.sized_interval();
    interval.forcing = forcing;
    heat.prepare(interval);
    return interval;
  };
  for (const IntervalForcing& forcing : history.tail())
    record.tail.push_back(heat_interval(forcing));
  const auto intervals = plan.intervals();
  const std::int64_t now_ns = intervals.back().end_ns;
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    const HistoryInterval& interval = intervals[i];
    record.intervals.push_back(heat_interval(history.intervals()[i]));
    IntervalRays& rays = record.rays.emplace_back(prototype);
    rays.update(interval.begin_ns, interval.end_ns, static_cast<std::uint32_t>(i), environment,
                EntityPoses(entities), origin_world_m);
    const std::int64_t middle_ns = interval.begin_ns + (interval.end_ns - interval.begin_ns) / 2;
    record.lag_s.push_back(static_cast<float>(static_cast<double>(now_ns - middle_ns) * 1e-9));
  }
  return record;
}

}  // namespace emit::renderer
