// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/matrix_double3x3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "emit/reference/visibility.hpp"
#include "ray_set.hpp"

namespace emit::reference {

/// Hierarchies of a scene.
struct RayScene::Impl {
  embree::Device device;  // declared before the sets, so that it is released after them
  RaySceneDesc desc;
  RayArithmetic arithmetic = RayArithmetic::exact;
  std::unique_ptr<RaySet> fixed;
  std::vector<std::unique_ptr<RaySet>> entities;
  std::size_t triangles = 0;
  std::size_t dropped = 0;
};

/// Set of an entity at its pose of an instant.
struct PlacedEntity {
  const RaySet* set = nullptr;
  physics::Pose pose;
  bool on = true;
  glm::dmat3 world_from_body{1.0};
  glm::dvec3 centre_world_m{0.0};
};

/// Entities of a scene at an instant.
struct SceneInstant::Impl {
  const RayScene::Impl* scene = nullptr;
  std::vector<PlacedEntity> entities;

  /// Returns the distance to a plane that rounding alone may cause, for a point with these world
  /// coordinates.
  [[nodiscard]] double plane_m(const glm::dvec3& point_world_m, double tolerance_m) const noexcept;
  /// Returns the ray relative to the static set.
  [[nodiscard]] PreparedRay in_fixed(const Ray& ray) const noexcept;
  /// Returns the ray in the frame of an entity's set.
  [[nodiscard]] PreparedRay in_entity(const PlacedEntity& entity, const Ray& ray) const noexcept;
  /// Returns true if the ray may hit the entity.
  [[nodiscard]] bool near(const PlacedEntity& entity, const Ray& ray) const noexcept;

  /// Returns a mask whose bit i is set if rays[i] is blocked.
  /// @pre at most 16 rays.
  [[nodiscard]] std::uint32_t blocked_16(std::span<const Ray> rays) const;

  /// Collects the triangles that may stand before a disc, relative to the point. Triangles whose
  /// plane contains the point are left out.
  void gather(const SurfacePoint& point, const glm::dvec3& axis, double semi_angle_rad,
              std::vector<std::array<glm::dvec3, 3>>& out) const;

  /// Completes a hit of a set to a hit in the world frame.
  [[nodiscard]] RayHit complete(const Ray& ray, const RaySet& set, const SetHit& hit,
                                const PlacedEntity* entity) const;

  /// Returns the start of rays from a point. Fast arithmetic moves it off the surface by the
  /// float32 error.
  [[nodiscard]] glm::dvec3 start_m(const SurfacePoint& point) const noexcept;
};

}  // namespace emit::reference
