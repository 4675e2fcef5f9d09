// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {

/// Faces with a prescribed temperature, which may be far hotter than all others. Their share of a
/// view comes from their areas: the form factor of a polygon (Lambert), times the share of it that
/// shadow rays find visible. Rays into the hemisphere would miss small ones, and find 1 % of a
/// share of a tenth only with ten thousand of them. Immutable; any thread.
class HeldFaces {
 public:
  /// Largest number of faces that are treated so. With more there is none here, and rays find them.
  static constexpr std::size_t kMost = 256;

  /// Collects the faces. `entity_of_object` and `origin_world_m` are those of the rays.
  HeldFaces(const scene::SceneGeometry& geometry, std::span<const scene::Material> materials,
            std::span<const std::int32_t> entity_of_object, const glm::dvec3& origin_world_m);

  [[nodiscard]] bool empty() const noexcept { return faces_.empty(); }

  /// Part of a view that a face fills.
  struct Part {
    std::uint32_t instance = 0;
    std::uint32_t triangle = 0;
    float frac = 0.0F;    ///< of the hemisphere, weighted with the cosine
    bool behind = false;  ///< the side that its winding calls inside is seen
  };
  /// Replaces `parts` by what a point sees of the faces that are selected.
  void seen_from(const CasterRays& casters, const ViewPoint& point,
                 const CasterSelection& selection, std::vector<Part>& parts) const;

 private:
  struct Face {
    std::uint32_t instance = 0;
    std::uint32_t triangle = 0;
    std::int32_t entity = -1;
    std::array<glm::vec3, 3> corners_m;  ///< rel, or body axes of an entity; ccw from outside
    bool two_sided = false;              ///< a sheet
  };
  std::vector<Face> faces_;
};

/// Returns the cosine-weighted share of the hemisphere around `normal` that a polygon fills for a
/// point at the origin, by its edges: 1/(2 pi) sum of angle times (normal . unit normal of the
/// edge's plane). What lies below the tangent plane is cut off. It is above 0 for a triangle that
/// turns counter-clockwise as the point sees it.
[[nodiscard]] double form_factor(const std::array<glm::dvec3, 3>& corners_m,
                                 const glm::dvec3& normal) noexcept;

}  // namespace emit::renderer
