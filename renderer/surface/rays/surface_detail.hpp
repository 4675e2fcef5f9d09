// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <optional>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// The scene as loaded, where what is drawn and sampled has fewer triangles: where its surface lies
/// and which way it faces between the vertices that are left, and what it shades. Half a degree is
/// worth a tenth of a kelvin in the sun, which no bound on the surface's place holds. Immutable;
/// any thread; queries allocate nothing.
class SurfaceDetail {
 public:
  /// A point of the full surface, in axes of its mesh.
  struct Place {
    glm::vec3 position_m{0.0F};
    glm::vec3 normal{0.0F};  ///< unit length
  };

  /// `full` and `coarse` have the same instances; entities may not differ. `rays`: against `full`.
  SurfaceDetail(scene::SceneGeometry full, CasterRays rays, const scene::SceneGeometry& coarse);

  /// True when the coarse mesh has lost triangles and a static instance draws it.
  [[nodiscard]] bool has(std::uint32_t mesh) const noexcept {
    return !instance_of_mesh_.empty() && instance_of_mesh_[mesh] != kNone;
  }

  /// @pre has(mesh)
  [[nodiscard]] const scene::Mesh& full_mesh(std::uint32_t mesh) const noexcept {
    EMIT_DCHECK(has(mesh));
    return full_.meshes[mesh];
  }

  /// Where the full mesh lies next to a point of the coarse one, in axes of the mesh; none where
  /// the full surface is farther than `reach_m` along the coarse normal, faces elsewhere or is
  /// covered. @pre has(mesh)
  [[nodiscard]] std::optional<Place> place(std::uint32_t mesh, const glm::vec3& position_m,
                                           const glm::vec3& normal, float reach_m) const noexcept;

  /// Against all of the full scene.
  [[nodiscard]] const CasterRays& rays() const noexcept { return rays_; }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffU;

  scene::SceneGeometry full_;
  CasterRays rays_;
  std::vector<std::uint32_t> instance_of_mesh_;  ///< entry of full_.instances
};

}  // namespace emit::renderer
