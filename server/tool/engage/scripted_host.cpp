// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/scripted_host.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/scene/trajectory.hpp"

namespace emit::tool {

physics::Result<std::unique_ptr<ScriptedHost>> ScriptedHost::create(
    const scene::ScenarioDesc& scenario, std::int64_t start_ns, const ScriptedFlight& flight) {
  const auto fault = [&scenario](std::string_view text) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("{}: {}", scenario.file.string(), text));
  };
  if (scenario.sensor.trajectory.empty()) return fault("the sensor has no position to start from");
  const auto object = std::ranges::find_if(scenario.objects, [&](const auto& each) {
    return each.entity_id == flight.target_entity && flight.target_entity != 0;
  });
  if (object == scenario.objects.end()) {
    return fault(fmt::format("no object has the entity_id {} of the target", flight.target_entity));
  }
  if (object->trajectory.empty()) return fault("the target has no position");
  // The scenario may be gone while the host flies, so the host keeps the target's way.
  const server::Engagement::Target target = [way = object->trajectory, start_ns,
                                             aim = flight.aim_body_m](double time_s) {
    const auto sim_time_ns = start_ns + static_cast<std::int64_t>(std::llround(time_s * 1e9));
    const physics::Pose pose = scene::trajectory_at(way, sim_time_ns).pose;
    return pose.position_world_m + pose.world_from_body * aim;
  };
  server::MissileState launch;
  launch.position_m =
      scene::trajectory_at(scenario.sensor.trajectory, start_ns).pose.position_world_m;
  const glm::dvec3 way = target(0.0) - launch.position_m;
  if (glm::length(way) < 1.0) return fault("the sensor starts at the target");
  // Turn the direction to the target about the vertical.
  const double c = std::cos(flight.heading_error_rad);
  const double s = std::sin(flight.heading_error_rad);
  const glm::dvec3 ahead = glm::normalize(way);
  launch.velocity_m_s =
      flight.speed_m_s * glm::dvec3(c * ahead.x + s * ahead.y, c * ahead.y - s * ahead.x, ahead.z);
  server::EngagementOptions options = flight.engagement;
  options.missile.ground_height_m = scenario.place.height_m;
  return std::unique_ptr<ScriptedHost>(new ScriptedHost(options, launch, target));
}

FlightTruth ScriptedHost::truth() const noexcept {
  FlightTruth out;
  const server::Missile& missile = engagement_.missile();
  out.velocity_m_s = missile.state().velocity_m_s;
  out.range_m = engagement_.range_m();
  out.boresight_error_rad = engagement_.boresight_error_rad();
  out.command_m_s2 = glm::length(engagement_.command_m_s2());
  out.lift_m_s2 = glm::length(missile.state().lift_m_s2);
  out.angle_of_attack_rad = missile.angle_of_attack_rad();
  out.line_of_sight_rate_rad_s = glm::length(engagement_.line_of_sight().rate_rad_s());
  return out;
}

physics::Result<bool> ScriptedHost::advance(double step_s) {
  engagement_.advance(step_s);
  return !engagement_.finished();
}

}  // namespace emit::tool
