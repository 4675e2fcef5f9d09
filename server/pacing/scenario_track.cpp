// SPDX-License-Identifier: Apache-2.0
#include "pacing/scenario_track.hpp"

#include <algorithm>

namespace emit::server {

ScenarioPose pose_on(const scene::Trajectory& trajectory, std::int64_t sim_time_ns) noexcept {
  const auto after = std::upper_bound(
      trajectory.begin(), trajectory.end(), sim_time_ns,
      [](std::int64_t time_ns, const scene::Keyframe& key) { return time_ns < key.sim_time_ns; });
  if (after == trajectory.begin()) {
    return {after->pose, after->on};
  }
  const scene::Keyframe& from = *(after - 1);
  if (after == trajectory.end() || after->teleport) {
    return {from.pose, from.on};
  }
  const double fraction = static_cast<double>(sim_time_ns - from.sim_time_ns) /
                          static_cast<double>(after->sim_time_ns - from.sim_time_ns);
  return {physics::interpolate(from.pose, after->pose, fraction), from.on};
}

ScenarioTracks::ScenarioTracks(const std::optional<scene::ScenarioDesc>& scenario)
    : any_entity_(!scenario) {
  if (!scenario) {
    return;
  }
  for (const auto& object : scenario->objects) {
    if (object.entity_id == 0) {
      continue;
    }
    Entity entity;
    entity.id = object.entity_id;
    if (!object.instances.empty()) {
      entity.start.pose = object.instances.front();
    }
    entity.start.on = object.on;
    entity.trajectory = object.trajectory;
    entities_.push_back(std::move(entity));
  }
  std::sort(entities_.begin(), entities_.end(),
            [](const Entity& a, const Entity& b) { return a.id < b.id; });
  sensor_ = scenario->sensor.trajectory;
}

const ScenarioTracks::Entity* ScenarioTracks::find(std::uint32_t entity_id) const noexcept {
  const auto found =
      std::lower_bound(entities_.begin(), entities_.end(), entity_id,
                       [](const Entity& entity, std::uint32_t id) { return entity.id < id; });
  return found != entities_.end() && found->id == entity_id ? &*found : nullptr;
}

bool ScenarioTracks::knows(std::uint32_t entity_id) const noexcept {
  return any_entity_ || find(entity_id) != nullptr;
}

ScenarioPose ScenarioTracks::entity_at(std::uint32_t entity_id,
                                       std::int64_t sim_time_ns) const noexcept {
  const Entity* entity = find(entity_id);
  if (entity == nullptr) {
    return {};
  }
  return entity->trajectory.empty() ? entity->start : pose_on(entity->trajectory, sim_time_ns);
}

physics::Pose ScenarioTracks::sensor_at(std::int64_t sim_time_ns) const noexcept {
  return sensor_.empty() ? physics::Pose{} : pose_on(sensor_, sim_time_ns).pose;
}

}  // namespace emit::server
