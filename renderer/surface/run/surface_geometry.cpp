// SPDX-License-Identifier: Apache-2.0
#include "surface/run/surface_geometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace emit::renderer {

SurfaceGeometry::SurfaceGeometry(scene::SceneGeometry geometry,
                                 std::vector<std::int32_t> entity_of_object, CasterRays places,
                                 std::optional<SurfaceDetail> detail, BodyJoints joints)
    : geometry_(std::move(geometry)),
      entity_of_object_(std::move(entity_of_object)),
      places_(std::move(places)),
      detail_(std::move(detail)),
      joints_(std::move(joints)) {}

physics::Result<SurfaceGeometry> SurfaceGeometry::create(const scene::ScenarioDesc& scenario,
                                                         scene::SceneGeometry geometry,
                                                         std::vector<std::int32_t> entity_of_object,
                                                         std::optional<SurfaceDetail> detail) {
  auto places = CasterRays::create(
      geometry, detail ? std::optional(detail->rays().origin_world_m()) : std::nullopt);
  if (!places) return tl::unexpected(std::move(places.error()));
  // Check that the rays number the entities like the scenario does.
  std::size_t entity = 0;
  for (std::size_t object = 0; object < scenario.objects.size(); ++object) {
    if (scenario.objects[object].entity_id == 0) continue;
    if (entity >= places->entities() || places->object_of_entity(entity) != object) {
      return physics::make_error(
          physics::ErrorCode::config,
          fmt::format("entity object '{}' has no triangles", scenario.objects[object].name));
    }
    ++entity;
  }
  BodyJoints joints{scenario.contacts, {}};
  for (const scene::ObjectDesc& object : scenario.objects) joints.objects.push_back(object.name);
  return SurfaceGeometry(std::move(geometry), std::move(entity_of_object), std::move(*places),
                         std::move(detail), std::move(joints));
}

std::vector<scene::Aabb> SurfaceGeometry::entity_boxes_m() const {
  std::vector<scene::Aabb> boxes(entities());
  for (const scene::Instance& instance : geometry_.instances) {
    const std::int32_t entity = entity_of_object_[instance.object];
    if (entity < 0) continue;
    boxes[static_cast<std::size_t>(entity)].add(
        scene::transformed(geometry_.meshes[instance.mesh].bounds, instance.body_from_mesh));
  }
  return boxes;
}

float SurfaceGeometry::highest_static_m() const {
  double highest_m = -std::numeric_limits<double>::infinity();
  for (const scene::Instance& instance : geometry_.instances) {
    const scene::Aabb& box = geometry_.meshes[instance.mesh].bounds;
    if (entity_of_object_[instance.object] >= 0 || box.empty()) continue;
    highest_m = std::max(highest_m, scene::transformed(box, instance.world_from_mesh).max_m.z);
  }
  return static_cast<float>(highest_m - rays().origin_world_m().z);
}

std::vector<float> SurfaceGeometry::entity_radii_m() const {
  std::vector<float> radius_m(entities(), 0.0F);
  for (const scene::Instance& instance : geometry_.instances) {
    const std::int32_t entity = entity_of_object_[instance.object];
    if (entity < 0) continue;
    const scene::Aabb box =
        scene::transformed(geometry_.meshes[instance.mesh].bounds, instance.body_from_mesh);
    if (box.empty()) continue;
    const glm::dvec3 farthest = glm::max(glm::abs(box.min_m), glm::abs(box.max_m));
    float& radius = radius_m[static_cast<std::size_t>(entity)];
    radius = std::max(radius, static_cast<float>(glm::length(farthest)));
  }
  return radius_m;
}

}  // namespace emit::renderer
