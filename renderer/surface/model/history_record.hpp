// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "history/part_history.hpp"
#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/rays/interval_rays.hpp"

namespace emit::renderer {

/// Past that all samples share: its intervals with their forcing, gains and rays. Plain data.
struct HistoryRecord {
  std::vector<HeatInterval> tail;  ///< last intervals of the unshadowed spin-up, before the history
  std::vector<HeatInterval> intervals;  ///< intervals of the history, the oldest first
  std::vector<IntervalRays> rays;       ///< rays of each interval, in the same order
  std::vector<float> lag_s;  ///< time from the middle of each interval to the end of the record

  [[nodiscard]] std::size_t size() const noexcept { return intervals.size(); }
};

/// Returns the share of the sun that reaches a sample, by the energy on its face. `sun_frac` has
/// the share of each interval of the record. `day_j_m2` is what an unshadowed face gets in a whole
/// day: where the record is shorter than a day, nothing is known of the rest of it, and that counts
/// as unshadowed. The share is 1 where no sun shines on the face. RT-safe.
[[nodiscard]] double sun_share(const HistoryRecord& record, const SurfaceSample& sample,
                               std::span<const float> sun_frac, double day_j_m2) noexcept;

/// Inputs of make_history_record(). All of them must outlive the call.
struct RecordInputs {
  const SampleHeat& heat;                 ///< thermal model, which sizes and fills the gains
  const Environment& environment;         ///< sun and weather
  std::span<const PoseHistory> entities;  ///< poses of every entity
  const IntervalRays& prototype;         ///< rays to copy for each interval, sized for the entities
  glm::dvec3 origin_world_m;             ///< origin of rel
  std::span<const PartHistory> parts{};  ///< drives of the parts of entities
};

/// Makes the record of all intervals of the plan. The first one begins where the history does, and
/// the record also holds the tail of the spin-up. Setup only: it allocates.
/// @pre history.update() has been called with this plan
[[nodiscard]] HistoryRecord make_history_record(const StepPlan& plan, const SurfaceHistory& history,
                                                const RecordInputs& inputs);

}  // namespace emit::renderer
