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

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// A half-line in rel axes: world axes, metres, relative to CasterRays::origin_world_m(). The
/// direction has unit length. Whatever lies at the origin itself is not met: the caller lifts the
/// origin off the surface by more than float32 resolves there (2^-23 of the distance from the
/// origin of rel).
struct CasterRay {
  glm::vec3 origin_m;
  glm::vec3 direction;
};

/// Where a moving object stands: rel = rel_from_body * body + position_m. `on` false: it is not
/// there.
struct MoverPlacement {
  glm::mat3 rel_from_body{1.0F};
  glm::vec3 position_m{0.0F};
  bool on = true;
};

/// The nearest face along a ray.
struct CasterHit {
  std::uint32_t instance = 0;   ///< index into SceneGeometry::instances
  std::uint32_t triangle = 0;   ///< of its mesh: first index / 3
  glm::vec2 barycentric{0.0F};  ///< weights of the triangle's second and third vertex
  float distance_m = 0.0F;
  bool front = true;       ///< seen from the side its winding calls outside
  glm::vec3 normal{0.0F};  ///< geometric, unit length, rel axes, to the outside of the winding
};

/// What a query of hits looks at. Entry m of `movers` places mover m; fewer entries than movers:
/// the rest is not there.
struct CasterSelection {
  bool fixed = true;  ///< static geometry
  std::span<const MoverPlacement> movers;
};

/// What shades and what is seen: one Embree hierarchy for static geometry, one per moving object in
/// its body axes. float32 around a local origin each, so far-off scenes lose no detail. Both sides
/// of every face count. Static instances of one mesh share its triangles where copies would cost
/// much memory.
///
/// Immutable; queries run in parallel, allocate nothing, and the same query gives the same answer
/// whatever the number of threads.
class CasterRays {
 public:
  static constexpr std::size_t kMaxRays = 16;                               ///< of one call
  static constexpr std::uint32_t kAllRays = (1U << kMaxRays) - 1U;          ///< bits of `wanted`
  static constexpr std::uint64_t kFlatTriangles = std::uint64_t{1} << 24U;  ///< about 2 GB

  /// Takes instances with entity_id 0 by world_from_mesh and the others by body_from_mesh. Setup
  /// only; seconds for 1e7 triangles. `origin_world_m`: where another one's is the same; none: the
  /// centre of the geometry's bulk. `flat_triangles`: of larger rigid frames, meshes that stand
  /// more than once are stored once, which is slower to trace. Errors: invalid_argument (an index
  /// out of range, more than 2^31 triangles or a scene wider than 1e8 m), internal (Embree ran out
  /// of memory).
  [[nodiscard]] static physics::Result<CasterRays> create(
      const scene::SceneGeometry& geometry,
      const std::optional<glm::dvec3>& origin_world_m = std::nullopt,
      std::uint64_t flat_triangles = kFlatTriangles);
  CasterRays(CasterRays&&) noexcept;
  CasterRays& operator=(CasterRays&&) noexcept;
  ~CasterRays();

  /// As asked for; else the centre of the bulk of the static geometry, or of everything where
  /// nothing is static (bulk_bounds()).
  [[nodiscard]] const glm::dvec3& origin_world_m() const noexcept;
  /// Moving objects that own an instance, ascending by Instance::object.
  [[nodiscard]] std::size_t movers() const noexcept;
  [[nodiscard]] std::uint32_t object_of_mover(std::size_t mover) const noexcept;

  /// Bit i is set where ray i (of at most kMaxRays; rays of one call should be alike in origin or
  /// direction) meets static geometry. Only rays whose bit in `wanted` is set are asked for.
  /// @pre rays.size() <= kMaxRays
  [[nodiscard]] std::uint32_t blocked_static(std::span<const CasterRay> rays,
                                             std::uint32_t wanted = kAllRays) const noexcept;
  /// The same for mover `mover` standing at `placement`.
  [[nodiscard]] std::uint32_t blocked_mover(std::size_t mover, const MoverPlacement& placement,
                                            std::span<const CasterRay> rays) const noexcept;
  /// The same for a mover that stands elsewhere for every ray: ray i meets it at placements[i].
  /// @pre placements.size() >= rays.size()
  [[nodiscard]] std::uint32_t blocked_moving(std::size_t mover,
                                             std::span<const MoverPlacement> placements,
                                             std::span<const CasterRay> rays,
                                             std::uint32_t wanted = kAllRays) const noexcept;
  /// The same for rays in the axes of the mover's body, relative to the body's origin: how a body
  /// shades itself, without the rounding of a far-off placement.
  [[nodiscard]] std::uint32_t blocked_in_body(std::size_t mover,
                                              std::span<const CasterRay> rays) const noexcept;

  /// The same for everything that is selected.
  [[nodiscard]] std::uint32_t blocked(std::span<const CasterRay> rays,
                                      const CasterSelection& selection) const noexcept;

  /// The nearest face of static geometry and of the movers where `movers` puts them.
  [[nodiscard]] std::optional<CasterHit> first_hit(
      const CasterRay& ray, std::span<const MoverPlacement> movers) const noexcept;
  /// Hits of up to kMaxRays rays; hits.size() >= rays.size(). Bit i of the result is set where
  /// hits[i] was written. To stay in the axes of a body, select that mover alone with the default
  /// placement and nothing fixed. Faces `within_m` and farther are not met.
  std::uint32_t first_hits(std::span<const CasterRay> rays, const CasterSelection& selection,
                           std::span<CasterHit> hits,
                           float within_m = std::numeric_limits<float>::infinity()) const noexcept;

 private:
  struct Impl;
  explicit CasterRays(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::renderer
