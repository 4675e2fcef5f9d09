// SPDX-License-Identifier: Apache-2.0
#include "surface/model/history_record.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Makes an interval with this forcing and with the gains of the thermal model.
HeatInterval heat_interval(const IntervalForcing& forcing, const SampleHeat& heat) {
  HeatInterval interval = heat.sized_interval();
  interval.forcing = forcing;
  heat.prepare(interval);
  return interval;
}

/// Appends an interval of the plan. `end_ns` is the instant at which the record ends; lags count to
/// it.
void append(HistoryRecord& record, const HistoryInterval& interval, const IntervalForcing& forcing,
            std::int64_t end_ns, const RecordInputs& inputs) {
  const auto turn = static_cast<std::uint32_t>(record.size());
  record.intervals.push_back(heat_interval(forcing, inputs.heat));
  record.intervals.back().entities.update(inputs.parts, inputs.entities, forcing, interval.begin_ns,
                                          interval.end_ns);
  IntervalRays& rays = record.rays.emplace_back(inputs.prototype);
  rays.update(interval.begin_ns, interval.end_ns, turn, inputs.environment,
              EntityPoses(inputs.entities), inputs.origin_world_m);
  // Measure the lag from the middle: the shadow of an interval counts as that of its middle.
  const std::int64_t middle_ns = interval.begin_ns + (interval.end_ns - interval.begin_ns) / 2;
  record.lag_s.push_back(static_cast<float>(static_cast<double>(end_ns - middle_ns) * 1e-9));
}

}  // namespace

double sun_share(const HistoryRecord& record, const SurfaceSample& sample,
                 std::span<const float> sun_frac, double day_j_m2) noexcept {
  EMIT_DCHECK_OP(sun_frac.size(), ==, record.size());
  double all_j_m2 = 0.0;
  double hidden_j_m2 = 0.0;
  for (std::size_t i = 0; i < record.size(); ++i) {
    if (!record.rays[i].sun_up()) continue;
    const IntervalForcing& forcing = record.intervals[i].forcing;
    const glm::dvec3 normal(record.rays[i].normal(sample));
    const double sun_j_m2 = 0.5 * forcing.dt_s *
                            (std::max(0.0, glm::dot(normal, forcing.begin.sun_w_m2)) +
                             std::max(0.0, glm::dot(normal, forcing.end.sun_w_m2)));
    all_j_m2 += sun_j_m2;
    hidden_j_m2 += sun_j_m2 * (1.0 - static_cast<double>(sun_frac[i]));
  }
  const double known_j_m2 = std::max(all_j_m2, day_j_m2);
  return known_j_m2 > 0.0 ? 1.0 - hidden_j_m2 / known_j_m2 : 1.0;
}

HistoryRecord make_history_record(const StepPlan& plan, const SurfaceHistory& history,
                                  const RecordInputs& inputs) {
  const auto intervals = plan.intervals();
  EMIT_CHECK_OP(history.intervals().size(), ==, intervals.size());
  HistoryRecord record;
  for (const IntervalForcing& forcing : history.tail()) {
    record.tail.push_back(heat_interval(forcing, inputs.heat));
  }
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    append(record, intervals[i], history.intervals()[i], intervals.back().end_ns, inputs);
  }
  return record;
}

}  // namespace emit::renderer
