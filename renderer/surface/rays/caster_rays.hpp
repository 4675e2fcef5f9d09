// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::renderer {

/// Half-line in rel: world axes, metres, relative to CasterRays::origin_world_m(). The direction
/// has unit length. A face at the origin itself is not hit: the caller lifts the origin off the
/// surface by more than float32 resolves there (2^-23 of the distance from the origin of rel).
struct CasterRay {
  glm::vec3 origin_m;
  glm::vec3 direction;
};

/// Placement of an entity: rel = rel_from_body * body + position_m.
struct EntityPlacement {
  glm::mat3 rel_from_body{1.0F};
  glm::vec3 position_m{0.0F};
  bool on = true;  ///< false: the entity is not in the scene
};
/// Returns the placement of an entity in a state of its trajectory. `origin_world_m` is the origin
/// of rel in the world. RT-safe.
[[nodiscard]] inline EntityPlacement placement_of(const scene::TrajectoryState& state,
                                                  const glm::dvec3& origin_world_m) noexcept {
  return {glm::mat3(glm::mat3_cast(state.pose.world_from_body)),
          glm::vec3(state.pose.position_world_m - origin_world_m), state.on};
}

/// Nearest face along a ray.
struct CasterHit {
  std::uint32_t instance = 0;   ///< index into SceneGeometry::instances
  std::uint32_t triangle = 0;   ///< triangle of its mesh: first index / 3
  glm::vec2 barycentric{0.0F};  ///< weights of the triangle's second and third vertex
  float distance_m = 0.0F;
  bool front = true;  ///< seen from the side that its winding calls outside
  /// Geometric normal: unit length, rel axes, to the side that the winding calls outside.
  glm::vec3 normal{0.0F};
};

/// Selection of the geometry that a query looks at. Entry m of `entities` places entity m; entities
/// without an entry are not in the scene.
struct CasterSelection {
  bool fixed = true;  ///< static geometry is included
  std::span<const EntityPlacement> entities;
};

/// Ray queries against the scene: one Embree hierarchy for static geometry and one per entity in
/// its body axes. Each is float32 around a local origin, so that far-off scenes lose no detail.
/// Both sides of every face count. Static instances of one mesh share its triangles if copies would
/// cost much memory.
///
/// Immutable. Queries run in parallel and allocate nothing, and the same query gives the same
/// answer for any number of threads.
class CasterRays {
 public:
  static constexpr std::size_t kMaxRays = 16;                       ///< rays of one call
  static constexpr std::uint32_t kAllRays = (1U << kMaxRays) - 1U;  ///< bits of `wanted`
  /// Default of `flat_triangles`. So many triangles take about 2 GB.
  static constexpr std::uint64_t kFlatTriangles = std::uint64_t{1} << 24U;

  /// Builds the hierarchies. Instances with entity_id 0 are placed by world_from_mesh and the
  /// others by body_from_mesh. `origin_world_m` sets the origin of rel, to share that of another
  /// object; without it the centre of the geometry's bulk is used (bulk_bounds()). In a rigid frame
  /// of more than `flat_triangles` triangles, meshes that appear more than once are stored once,
  /// which is slower to trace.
  /// Setup only: it takes seconds for 1e7 triangles. Errors: invalid_argument (an index out of
  /// range, more than 2^31 triangles or a scene wider than 1e8 m), internal (Embree ran out of
  /// memory).
  [[nodiscard]] static physics::Result<CasterRays> create(
      const scene::SceneGeometry& geometry,
      const std::optional<glm::dvec3>& origin_world_m = std::nullopt,
      std::uint64_t flat_triangles = kFlatTriangles);
  CasterRays(CasterRays&&) noexcept;
  CasterRays& operator=(CasterRays&&) noexcept;
  ~CasterRays();

  /// Returns the origin of rel. It is the one that was given to create(), else the centre of the
  /// bulk of the static geometry, or of everything if nothing is static (bulk_bounds()).
  [[nodiscard]] const glm::dvec3& origin_world_m() const noexcept;
  /// Returns the number of entities that have an instance. They are numbered in the order of
  /// Instance::object.
  [[nodiscard]] std::size_t entities() const noexcept;
  /// Returns the object of an entity. @pre entity < entities()
  [[nodiscard]] std::uint32_t object_of_entity(std::size_t entity) const noexcept;

  /// Returns bits: bit i is set if ray i hits static geometry. Rays of one call should be alike in
  /// origin or direction. Only rays whose bit in `wanted` is set are traced.
  /// @pre rays.size() <= kMaxRays
  [[nodiscard]] std::uint32_t blocked_static(std::span<const CasterRay> rays,
                                             std::uint32_t wanted = kAllRays) const noexcept;
  /// Returns the same bits for one entity at `placement`.
  [[nodiscard]] std::uint32_t blocked_entity(std::size_t entity, const EntityPlacement& placement,
                                             std::span<const CasterRay> rays) const noexcept;
  /// Returns the same bits for an entity that stands elsewhere for every ray: ray i meets it at
  /// placements[i].
  /// @pre placements.size() >= rays.size()
  [[nodiscard]] std::uint32_t blocked_moving(std::size_t entity,
                                             std::span<const EntityPlacement> placements,
                                             std::span<const CasterRay> rays,
                                             std::uint32_t wanted = kAllRays) const noexcept;
  /// Returns the same bits for rays in the axes of the body of an entity, relative to the origin of
  /// the body. This tells how an entity shades itself, without the rounding of a far-off placement.
  [[nodiscard]] std::uint32_t blocked_in_body(std::size_t entity, std::span<const CasterRay> rays,
                                              std::uint32_t wanted = kAllRays) const noexcept;

  /// Returns the same bits for everything that is selected.
  [[nodiscard]] std::uint32_t blocked(std::span<const CasterRay> rays,
                                      const CasterSelection& selection) const noexcept;

  /// Returns the nearest face of static geometry and of the entities at the placements `entities`.
  [[nodiscard]] std::optional<CasterHit> first_hit(
      const CasterRay& ray, std::span<const EntityPlacement> entities) const noexcept;
  /// Finds the nearest faces of up to kMaxRays rays. Bit i of the result is set if hits[i] was
  /// written. To trace in the axes of a body, select that entity alone with the default placement
  /// and no static geometry. Faces at `within_m` and farther are ignored.
  /// @pre `hits` has an entry per ray
  std::uint32_t first_hits(std::span<const CasterRay> rays, const CasterSelection& selection,
                           std::span<CasterHit> hits,
                           float within_m = std::numeric_limits<float>::infinity()) const noexcept;

 private:
  struct Impl;
  explicit CasterRays(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::renderer
