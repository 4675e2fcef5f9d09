// SPDX-License-Identifier: Apache-2.0
#include "history/entity_air.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>

namespace emit::renderer {

physics::AirFilmBody entity_film_body(const scene::ScenarioDesc& scenario,
                                      const scene::SceneGeometry& geometry, std::size_t object) {
  physics::AirFilmBody body = scenario.objects[object].air_film;
  if (body.length_m > 0.0) return body;
  // Take the box around all meshes of the object in body axes.
  glm::dvec3 low(std::numeric_limits<double>::max());
  glm::dvec3 high(std::numeric_limits<double>::lowest());
  for (const scene::Instance& instance : geometry.instances) {
    if (instance.object != object) continue;
    for (const glm::vec3& p_mesh_m : geometry.meshes[instance.mesh].positions_m) {
      const glm::dvec3 p_body_m(instance.body_from_mesh * glm::dvec4(p_mesh_m, 1.0));
      low = glm::min(low, p_body_m);
      high = glm::max(high, p_body_m);
    }
  }
  constexpr double kShortestM = 0.01;
  const glm::dvec3 size_m = high - low;
  body.length_m = std::max({size_m.x, size_m.y, size_m.z, kShortestM});
  return body;
}

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
