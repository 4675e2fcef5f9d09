// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/surface_detail.hpp"

namespace emit::renderer {

/// Geometry of a cached surface before refinement, the entities in it, and the rays against it.
/// Immutable after construction; any thread.
class SurfaceGeometry {
 public:
  /// Builds the rays. `entity_of_object` holds the index of each object's PoseHistory, or -1 for
  /// static objects. `detail` is given if meshes were simplified. Errors: config (an entity without
  /// triangles), those of CasterRays.
  [[nodiscard]] static physics::Result<SurfaceGeometry> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<std::int32_t> entity_of_object, std::optional<SurfaceDetail> detail);

  [[nodiscard]] const scene::SceneGeometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] std::span<const scene::Material> materials() const noexcept {
    return geometry_.materials;
  }
  [[nodiscard]] std::span<const std::int32_t> entity_of_object() const noexcept {
    return entity_of_object_;
  }
  [[nodiscard]] const BodyJoints& joints() const noexcept { return joints_; }
  /// Number of entities.
  [[nodiscard]] std::size_t entities() const noexcept { return places_.entities(); }
  /// Box of each entity's geometry in the axes of its body.
  [[nodiscard]] std::vector<scene::Aabb> entity_boxes_m() const;
  /// Height of the highest point of static geometry, rel; minus infinity if nothing is static.
  [[nodiscard]] float highest_static_m() const;
  /// Radius of each entity's geometry around the origin of its body, in m.
  [[nodiscard]] std::vector<float> entity_radii_m() const;

  /// Rays against everything that shades, as loaded.
  [[nodiscard]] const CasterRays& rays() const noexcept {
    return detail_ ? detail_->rays() : places_;
  }
  /// Rays against geometry(), with the same origin. They find the place that a ray hits.
  [[nodiscard]] const CasterRays& places() const noexcept { return places_; }
  /// The meshes as loaded; null if no mesh has lost triangles.
  [[nodiscard]] const SurfaceDetail* detail() const noexcept {
    return detail_ ? &*detail_ : nullptr;
  }
  /// Origin of rel in the world, m.
  [[nodiscard]] const glm::dvec3& origin_world_m() const noexcept {
    return rays().origin_world_m();
  }

 private:
  SurfaceGeometry(scene::SceneGeometry geometry, std::vector<std::int32_t> entity_of_object,
                  CasterRays places, std::optional<SurfaceDetail> detail, BodyJoints joints);

  scene::SceneGeometry geometry_;
  std::vector<std::int32_t> entity_of_object_;
  CasterRays places_;
  std::optional<SurfaceDetail> detail_;
  BodyJoints joints_;
};

}  // namespace emit::renderer
