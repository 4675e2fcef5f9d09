// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/interval_rays.hpp"

namespace emit::renderer {

/// Parts of entities with a prescribed temperature of 380 K and more, as surfaces that stand still
/// see them. They are small and far hotter than the rest, so that a mean over the faces of their
/// entity loses them. Near by, each face counts by Lambert's form factor; from eight radii of the
/// part on, by its projected area. Four shadow rays a face, or four for the part, find what is
/// visible. A part counts while its entity stands still; parts that host or script heat are not
/// among these, and stay in the mean. Immutable; any thread.
class HotParts {
 public:
  HotParts() = default;
  /// Returns whether faces of a material are such parts where they belong to an entity.
  [[nodiscard]] static bool hot(const scene::Material& material) noexcept {
    constexpr double kHotK = 380.0;
    return material.prescribed_k.value_or(0.0) >= kHotK;
  }
  /// Collects the parts. `entity_of_object` has the entity of every object, or -1 for a static one.
  HotParts(const scene::SceneGeometry& geometry, std::span<const std::int32_t> entity_of_object);

  [[nodiscard]] bool empty() const noexcept { return parts_.empty(); }
  /// Returns what the parts send to a face, W/m2: above what a blackbody of 300 K sends from where
  /// they are seen. `start_m` lies before the face, and `normal` is its unit normal (rel). RT-safe.
  [[nodiscard]] float on_w_m2(const CasterRays& rays, const IntervalRays& interval,
                              const glm::vec3& start_m, const glm::vec3& normal) const noexcept;
  /// Returns the most that a part can send to a place of a triangle that is wider than `wide_frac`
  /// of the way to the part, W/m2: what corners so far apart cannot know. Nothing hides a part
  /// here. `corners_m` and `normal` are those of the triangle (rel). RT-safe.
  [[nodiscard]] float missed_w_m2(const IntervalRays& interval,
                                  const std::array<glm::vec3, 3>& corners_m,
                                  const glm::vec3& normal, float wide_frac) const noexcept;
  /// Returns whether no entity with such a part has moved, come or gone between two intervals.
  [[nodiscard]] bool same(const IntervalRays& before, const IntervalRays& now) const noexcept;

 private:
  struct Face {
    std::array<glm::vec3, 3> corners_m;  ///< body axes; counter-clockwise from outside
    glm::vec3 area_m2{0.0F};             ///< normal times area
    bool two_sided = false;              ///< a sheet
  };
  /// Faces of one material of one entity.
  struct Part {
    std::size_t entity = 0;
    glm::vec3 centre_m{0.0F};  ///< body axes
    float radius_m = 0.0F;
    float sent_w_m2 = 0.0F;  ///< by a face, above the blackbody of 300 K
    float area_m2 = 0.0F;    ///< of all faces
    std::vector<Face> faces;
  };
  [[nodiscard]] float near_w_m2(const Part& part, const EntityPlacement& place,
                                const CasterRays& rays, const CasterSelection& selection,
                                const glm::vec3& start_m, const glm::vec3& normal) const noexcept;
  [[nodiscard]] float far_w_m2(const Part& part, const EntityPlacement& place,
                               const CasterRays& rays, const CasterSelection& selection,
                               const glm::vec3& start_m, const glm::vec3& normal) const noexcept;
  std::vector<Part> parts_;
};

}  // namespace emit::renderer
