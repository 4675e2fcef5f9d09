// SPDX-License-Identifier: Apache-2.0
#include "gateway/scene_query.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/scene/mesh.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::server {

using reference::RayScene;
using reference::SceneInstant;

physics::Result<SceneQuery> SceneQuery::create(const scene::ScenarioDesc& scenario) {
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected<physics::Error>(std::move(geometry.error()));
  auto rays = RayScene::create(reference::ray_scene_desc(scenario, *geometry));
  if (!rays) return tl::unexpected<physics::Error>(std::move(rays.error()));
  std::vector<std::string> materials;
  for (const scene::Material& material : geometry->materials) materials.push_back(material.name);
  const double top_m = geometry->static_bounds.empty() ? 0.0 : geometry->static_bounds.max_m.z;
  return SceneQuery(std::make_unique<RayScene>(std::move(*rays)), std::move(materials), top_m);
}

SceneQuery::SceneQuery(std::unique_ptr<RayScene> scene, std::vector<std::string> materials,
                       double top_world_m)
    : scene_(std::move(scene)),
      materials_(std::move(materials)),
      top_world_m_(top_world_m),
      now_(scene_->at(0)),
      terrain_(scene_->at(0)) {
  for (std::uint32_t i = 0; i < scene_->desc().entities.size(); ++i) {
    terrain_.place(i, terrain_.entity_pose(i), false);
  }
}

void SceneQuery::place(std::uint32_t entity_id, const physics::Pose& pose, bool on) noexcept {
  const auto& entities = scene_->desc().entities;
  for (std::uint32_t i = 0; i < entities.size(); ++i) {
    if (entities[i].entity_id == entity_id) now_.place(i, pose, on);
  }
}

void SceneQuery::reset() noexcept {
  const auto& entities = scene_->desc().entities;
  for (std::uint32_t i = 0; i < entities.size(); ++i) {
    const scene::TrajectoryState start = scene::trajectory_at(entities[i].poses, 0);
    now_.place(i, start.pose, start.on);
  }
}

SceneQuery::Hit SceneQuery::complete(const reference::RayHit& hit,
                                     const glm::dvec3& direction_world) const noexcept {
  Hit out;
  out.range_m = hit.distance_m;
  out.position_world_m = hit.position_world_m;
  const bool faces_away = glm::dot(hit.geometric_normal, direction_world) > 0.0;
  out.normal_world = faces_away ? -hit.geometric_normal : hit.geometric_normal;
  out.material = hit.material;
  if (hit.entity != reference::kNoEntity) {
    out.entity_id = scene_->desc().entities[hit.entity].entity_id;
  }
  return out;
}

std::optional<SceneQuery::Hit> SceneQuery::first_hit(
    const glm::dvec3& origin_world_m, const glm::dvec3& direction_world) const noexcept {
  const auto hit = now_.first_hit({.origin_world_m = origin_world_m, .direction = direction_world});
  if (!hit) return std::nullopt;
  return complete(*hit, direction_world);
}

std::optional<SceneQuery::Hit> SceneQuery::ground(const glm::dvec3& point_world_m,
                                                  const glm::dvec3& up_world) const noexcept {
  // The ray starts above everything. A point so far away that its vertical lies in the world's
  // horizontal plane has no ground here.
  constexpr double kLeastUp = 0.1;
  if (up_world.z < kLeastUp) return std::nullopt;
  constexpr double kClearanceM = 1.0;
  const double climb_m = (top_world_m_ - point_world_m.z) / up_world.z;
  const glm::dvec3 start_m = point_world_m + up_world * (std::max(climb_m, 0.0) + kClearanceM);
  const auto hit = terrain_.first_hit({.origin_world_m = start_m, .direction = -up_world});
  if (!hit) return std::nullopt;
  return complete(*hit, -up_world);
}

}  // namespace emit::server
