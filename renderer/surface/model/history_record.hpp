// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/rays/interval_rays.hpp"

namespace emit::renderer {

/// The past that all samples share: intervals with their forcing, gains and rays, the newest last.
struct HistoryRecord {
  std::vector<HeatInterval> tail;  ///< unshadowed, before the history
  std::vector<HeatInterval> intervals;
  std::vector<IntervalRays> rays;  ///< of each interval
  std::vector<float> lag_s;        ///< from each interval's middle to the end of the last one

  [[nodiscard]] std::size_t size() const noexcept { return intervals.size(); }
};

/// Record of the plan's intervals. Setup only. @pre history.update() has seen the plan
[[nodiscard]] HistoryRecord make_history_record(const StepPlan& plan, const SurfaceHistory& history,
                                                const SampleHeat& heat,
                                                const Environment& environment,
                                                std::span<const PoseHistory> entities,
                                                const IntervalRays& prototype,
                                                const glm::dvec3& origin_world_m);

}  // namespace emit::renderer
