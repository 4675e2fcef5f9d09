// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Geometry of a scenario for questions of hosts: what a ray meets, and how high the ground is. It
/// decides every hit in double, so that an answer is good to a micrometre a hundred kilometres from
/// the origin too.
///
/// Thread: one owner. Real time: RT-safe after create().
class SceneQuery {
 public:
  /// Loads the scene and builds its hierarchies. Setup only. Errors: those of scene::load_scene(),
  /// internal (Embree).
  [[nodiscard]] static physics::Result<SceneQuery> create(const scene::ScenarioDesc& scenario);

  /// Moves an entity, or takes it out of the scene. Entities that the scenario has no geometry for
  /// are ignored. They stand where the scenario has them at its start until they are moved.
  void place(std::uint32_t entity_id, const physics::Pose& pose, bool on) noexcept;
  /// Moves all entities back to where they stand at the scenario's start.
  void reset() noexcept;

  struct Hit {
    double range_m = 0.0;
    glm::dvec3 position_world_m{0.0};
    glm::dvec3 normal_world{0.0, 0.0, 1.0};  ///< unit normal of the face, on the side of the ray
    std::uint32_t material = 0;              ///< index into materials()
    std::uint32_t entity_id = 0;             ///< entity that was hit; 0: static scenery
  };
  /// Returns the first thing that a ray meets; none: the sky.
  /// @param direction_world  unit vector
  [[nodiscard]] std::optional<Hit> first_hit(const glm::dvec3& origin_world_m,
                                             const glm::dvec3& direction_world) const noexcept;
  /// Returns the highest static surface on the vertical line through a point.
  /// @param up_world  unit vector of the vertical there
  [[nodiscard]] std::optional<Hit> ground(const glm::dvec3& point_world_m,
                                          const glm::dvec3& up_world) const noexcept;

  /// Returns the names of the materials in use.
  [[nodiscard]] const std::vector<std::string>& materials() const noexcept { return materials_; }

 private:
  SceneQuery(std::unique_ptr<reference::RayScene> scene, std::vector<std::string> materials,
             double top_world_m);
  [[nodiscard]] Hit complete(const reference::RayHit& hit,
                             const glm::dvec3& direction_world) const noexcept;

  std::unique_ptr<reference::RayScene> scene_;  ///< at a fixed address, for the instants
  std::vector<std::string> materials_;
  double top_world_m_ = 0.0;         ///< height of the highest static point above the origin
  reference::SceneInstant now_;      ///< with the entities where they are
  reference::SceneInstant terrain_;  ///< without entities
};

}  // namespace emit::server
