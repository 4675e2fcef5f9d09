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

/// What a record is made with.
struct RecordInputs {
  const SampleHeat& heat;
  const Environment& environment;
  std::span<const PoseHistory> entities;
  const IntervalRays& prototype;
  glm::dvec3 origin_world_m;
};

/// Record of the plan's intervals, from the start of the history. Setup only.
/// @pre history.update() has seen the plan
[[nodiscard]] HistoryRecord make_history_record(const StepPlan& plan, const SurfaceHistory& history,
                                                const RecordInputs& inputs);

/// Record of the plan's intervals, which begin where `history` has been brought to. Brings it to
/// their end. Setup only.
[[nodiscard]] HistoryRecord extend_history_record(const StepPlan& plan, SurfaceHistory& history,
                                                  const RecordInputs& inputs);

}  // namespace emit::renderer
