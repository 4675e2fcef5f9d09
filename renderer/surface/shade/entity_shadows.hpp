// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/shade/entity_shadow_maps.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Shadows that entities cast in the frame: the depth map of each, and the space that it may shade.
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor and begin() is RT-safe.
class EntityShadows {
 public:
  /// Space that an entity may shade, down to static surfaces.
  struct Shadow {
    /// The entity is there, the sun is up, and static geometry reaches as high as what is shaded.
    bool on = false;
    /// Points whose convex hull holds everything that is shaded, rel.
    std::array<glm::vec3, 12> hull_m;
  };

  EntityShadows() = default;
  /// Takes memory for one map per entity. `bounds_m` holds the box of each entity in the axes of
  /// its body. `highest_static_m` is the height of the highest static surface, rel: higher up
  /// nothing takes shade.
  EntityShadows(std::span<const scene::Aabb> bounds_m, float highest_static_m);

  /// Makes all depth maps for the poses and the sun of an instant. Setup. Frames make those anew
  /// whose entity has turned.
  void begin(std::int64_t now_ns, const Environment& environment,
             std::span<const PoseHistory> entities, const CasterRays& rays,
             threads::WorkerPool& workers);

  /// Begins a frame, which may make EntityShadowMaps::kLooksPerFrame maps anew.
  void begin_frame() noexcept { maps_.begin_frame(); }
  /// Finds shadows() for the poses of the entities at `drawn_ns` and the sun of `sun_ns`.
  /// @pre begin() with the same entities
  void place(std::int64_t drawn_ns, std::int64_t sun_ns, const Environment& environment,
             std::span<const PoseHistory> entities, const CasterRays& rays) noexcept;
  [[nodiscard]] std::span<const Shadow> shadows() const noexcept { return shadows_; }
  /// Brings the depth map of an entity up to date, and places it. Call it for shadows that show in
  /// the frame.
  /// @pre place(); shadows()[entity].on
  [[nodiscard]] PlacedShadowMap cast(std::size_t entity, const CasterRays& rays,
                                     threads::WorkerPool& workers) noexcept;
  /// Returns true if, since place(), more entities had turned than one frame can make maps for.
  /// Then some shadow has an outline of a while ago.
  [[nodiscard]] bool stale() const noexcept { return stale_; }

  /// The depth maps.
  [[nodiscard]] const EntityShadowMaps& maps() const noexcept { return maps_; }
  [[nodiscard]] EntityShadowMaps& maps() noexcept { return maps_; }

 private:
  /// Returns the height at which the shadow of an entity ends, rel: that of the lowest surface
  /// behind it, and a little lower. `corners_m` are those of its box.
  [[nodiscard]] float end_height_m(std::size_t entity, std::span<const glm::vec3, 8> corners_m,
                                   const CasterRays& rays) const noexcept;
  /// Returns the corners of a level rectangle at the height `at_m` around the shadow there,
  /// penumbra included. `corners_m` are those of the entity's box, rel.
  [[nodiscard]] std::array<glm::vec3, 4> rectangle_at(std::size_t entity,
                                                      std::span<const glm::vec3, 8> corners_m,
                                                      float at_m) const noexcept;

  EntityShadowMaps maps_;
  float highest_static_m_ = 0.0F;
  std::vector<EntityPlacement> placements_;  ///< by entity, of the latest place()
  std::vector<Shadow> shadows_;
  glm::vec3 to_sun_{0.0F, 0.0F, 1.0F};  ///< unit vector to the sun of shadows()
  bool stale_ = false;
};

}  // namespace emit::renderer
