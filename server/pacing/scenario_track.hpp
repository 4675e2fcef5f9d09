// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "emit/scene/scene_desc.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::server {

/// Sensor and entities as the scenario itself moves them.
///
/// Thread: any (read only). Real time: const functions are RT-safe.
class ScenarioTracks {
 public:
  /// Absent scenario: no entity is unknown, everything starts at the origin.
  explicit ScenarioTracks(const std::optional<scene::ScenarioDesc>& scenario);

  /// Returns true if there is a scenario, which says which entities there are.
  [[nodiscard]] bool has_entities() const noexcept { return !any_entity_; }
  [[nodiscard]] bool knows(std::uint32_t entity_id) const noexcept;
  /// Returns true if an entity has a part with this id that takes the kind of drive. Without a
  /// scenario it has any.
  [[nodiscard]] bool takes(std::uint32_t entity_id, std::uint32_t part_id,
                           scene::PartCommand::Kind drive) const noexcept;
  [[nodiscard]] scene::TrajectoryState entity_at(std::uint32_t entity_id,
                                                 std::int64_t sim_time_ns) const noexcept;
  [[nodiscard]] physics::Pose sensor_at(std::int64_t sim_time_ns) const noexcept;

 private:
  struct Entity {
    std::uint32_t id = 0;
    scene::TrajectoryState start;
    scene::Trajectory trajectory;
    struct Part {
      std::uint32_t id = 0;
      bool takes_throttle = false;
    };
    std::vector<Part> parts;
  };
  [[nodiscard]] const Entity* find(std::uint32_t entity_id) const noexcept;

  bool any_entity_ = true;
  std::vector<Entity> entities_;  // by id
  scene::Trajectory sensor_;
};

}  // namespace emit::server
