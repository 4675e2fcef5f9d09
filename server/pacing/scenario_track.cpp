// SPDX-License-Identifier: Apache-2.0
#include "pacing/scenario_track.hpp"

#include <algorithm>

namespace emit::server {

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
    for (const scene::PartDesc& part : object.parts) {
      entity.parts.push_back({part.id, part.curve.given});
    }
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

bool ScenarioTracks::takes(std::uint32_t entity_id, std::uint32_t part_id,
                           scene::PartCommand::Kind drive) const noexcept {
  if (any_entity_) {
    return true;
  }
  const Entity* entity = find(entity_id);
  return entity != nullptr &&
         std::any_of(entity->parts.begin(), entity->parts.end(), [&](const Entity::Part& part) {
           return part.id == part_id &&
                  (drive != scene::PartCommand::Kind::throttle || part.takes_throttle);
         });
}

scene::TrajectoryState ScenarioTracks::entity_at(std::uint32_t entity_id,
                                                 std::int64_t sim_time_ns) const noexcept {
  const Entity* entity = find(entity_id);
  if (entity == nullptr) {
    return {};
  }
  return entity->trajectory.empty() ? entity->start
                                    : scene::trajectory_at(entity->trajectory, sim_time_ns);
}

physics::Pose ScenarioTracks::sensor_at(std::int64_t sim_time_ns) const noexcept {
  return sensor_.empty() ? physics::Pose{} : scene::trajectory_at(sensor_, sim_time_ns).pose;
}

}  // namespace emit::server
