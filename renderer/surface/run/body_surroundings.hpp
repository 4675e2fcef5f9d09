// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "history/entity_stand.hpp"
#include "history/pose_history.hpp"
#include "surface/heat/body_view.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/run/surface_geometry.hpp"

namespace emit::renderer {

/// Views of entities that have moved since the warm-up, and of those that such entities have come
/// near (physics.md eq. 30). Rays from the middle of the six sides of the box around
/// a body find the surfaces there, and the samples on them say what they send.
///
/// An entity that moves, or has a moving one near it, looks around about once per step of
/// LocalSteps, with few rays. Once both stand it looks around with many, and again once per
/// interval. Entities take turns.
///
/// Owner: CachedSurface. Thread: the renderer's. Real time: everything but the constructor is
/// RT-safe.
class BodySurroundings {
 public:
  /// Times of the looks.
  struct Grid {
    std::int64_t start_ns = 0;
    std::int64_t interval_ns = 1;
    std::int64_t step_ns = 1;  ///< an entity has a turn once per step
    std::int64_t now_ns = 0;   ///< looks begin after it
  };

  /// `geometry` and `model` outlive the object. `anchors` are by entity.
  BodySurroundings(const SurfaceGeometry& geometry, const SurfaceModel& model,
                   std::vector<EntityAnchor> anchors, const Grid& grid);

  /// Looks from the entities whose turn comes up to `until_ns`. `outputs` are those of all samples.
  void run(std::int64_t until_ns, std::span<const PoseHistory> entities,
           std::span<const SampleOutput> outputs) noexcept;

  /// Views by entity, as of the latest looks; empty while no entity has moved.
  [[nodiscard]] std::span<const BodyView> views() const noexcept {
    return any_moved_ ? std::span<const BodyView>(views_) : std::span<const BodyView>();
  }

 private:
  static constexpr std::int64_t kTurns = 64;  ///< turns per step

  /// State of things at the latest look from an entity.
  struct Look {
    std::int64_t at_ns = 0;
    physics::Pose pose;
    bool fine = false;       ///< with many rays
    glm::dvec3 near_m{0.0};  ///< sum of the places of moved entities near it
  };
  /// Places all entities at an instant. Returns true if one of them has moved.
  bool place(std::int64_t at_ns, std::span<const PoseHistory> entities) noexcept;
  /// Returns true if the view of an entity is out of date. It then notes the look, and sets
  /// `traced_` to the entities near it.
  bool wants_look(std::size_t entity, std::int64_t at_ns) noexcept;
  void look(std::size_t entity, std::span<const SampleOutput> outputs) noexcept;
  /// Looks from a side whose middle and outward normal are given in rel, along directions around
  /// +z.
  [[nodiscard]] SideView look_from(const glm::vec3& from_m, const glm::vec3& normal,
                                   std::span<const glm::vec3> directions,
                                   std::span<const SampleOutput> outputs) const noexcept;
  /// Adds what a hit shows to the view of a side, with the share of a ray.
  void add(const CasterHit& hit, bool up, float ray_frac, std::span<const SampleOutput> outputs,
           SideView& side) const noexcept;

  const SurfaceGeometry& geometry_;
  const SurfaceModel& model_;
  std::vector<EntityAnchor> anchors_;
  std::vector<scene::Aabb> boxes_m_;
  Grid grid_;
  std::int64_t turn_ns_ = 1;
  std::int64_t next_turn_ = 0;
  bool any_moved_ = false;
  std::vector<BodyView> views_;
  std::vector<EntityStand> stands_;
  std::vector<Look> looks_;
  std::vector<physics::Pose> poses_;
  std::vector<EntityPlacement> placements_;
  std::vector<EntityPlacement> traced_;
};

}  // namespace emit::renderer
