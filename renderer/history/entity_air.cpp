// SPDX-License-Identifier: Apache-2.0
#include "history/entity_air.hpp"

#include <cmath>

namespace emit::renderer {

EntityAir entity_air(const PoseHistory& entity, const IntervalForcing& forcing,
                     std::int64_t begin_ns, std::int64_t end_ns) noexcept {
  const PoseHistory::Motion motion = entity.motion(begin_ns, end_ns);
  const auto flow_past = [&](const physics::AirFlow& open, std::int64_t at_ns) {
    physics::AirFlow flow = physics::raised_flow(open, entity.at(at_ns).pose.position_world_m.z);
    flow.flow_m_s -= motion.velocity_m_s;
    flow.undirected_m_s = std::hypot(flow.undirected_m_s, motion.undirected_m_s);
    return flow;
  };
  const physics::AirFlow begin = flow_past(forcing.begin.flow, begin_ns);
  const physics::AirFlow end = flow_past(forcing.end.flow, end_ns);
  const auto moist_at = [](const SurfaceForcing& open, const physics::AirFlow& flow) {
    const double humidity_frac =
        open.moist.vapour_pa / physics::saturation_over_water_pa(open.flow.air_k);
    return physics::moist_air(flow.air_k, flow.pressure_pa,
                              humidity_frac * physics::saturation_over_water_pa(flow.air_k));
  };
  return {physics::air_film(begin, entity.film_body()),
          physics::air_film(end, entity.film_body()),
          physics::felt_air_k(begin),
          physics::felt_air_k(end),
          moist_at(forcing.begin, begin),
          moist_at(forcing.end, end)};
}

}  // namespace emit::renderer
