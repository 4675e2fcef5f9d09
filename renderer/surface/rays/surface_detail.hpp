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

/// Scene as loaded, for meshes that are drawn and sampled with fewer triangles. It knows where the
/// surface lies and which way it faces between the vertices that are left. An error of half a
/// degree changes the temperature in the sun by a tenth of a kelvin, and no bound on the place of
/// the surface prevents it. Immutable; any thread; queries allocate nothing.
class SurfaceDetail {
 public:
  /// Point of the full surface, in the axes of its mesh.
  struct Place {
    glm::vec3 position_m{0.0F};
    glm::vec3 normal{0.0F};  ///< unit length
  };

  /// Takes the full scene and the rays against it.
  /// @pre `full` and `coarse` have as many instances and meshes; the meshes of entities are the
  /// same
  SurfaceDetail(scene::SceneGeometry full, CasterRays rays, const scene::SceneGeometry& coarse);

  /// Returns true if the coarse mesh has lost triangles and a static instance has it.
  [[nodiscard]] bool has(std::uint32_t mesh) const noexcept {
    return !instance_of_mesh_.empty() && instance_of_mesh_[mesh] != kNone;
  }

  /// Returns the mesh as loaded.
  /// @pre has(mesh)
  [[nodiscard]] const scene::Mesh& full_mesh(std::uint32_t mesh) const noexcept {
    EMIT_DCHECK(has(mesh));
    return full_.meshes[mesh];
  }

  /// Returns the point of the full mesh next to a point of the coarse one, in the axes of the mesh.
  /// It returns nothing if the full surface is farther than `reach_m` along the coarse normal,
  /// faces elsewhere or is covered.
  /// @pre has(mesh)
  [[nodiscard]] std::optional<Place> place(std::uint32_t mesh, const glm::vec3& position_m,
                                           const glm::vec3& normal, float reach_m) const noexcept;

  /// Returns the rays against the whole full scene.
  [[nodiscard]] const CasterRays& rays() const noexcept { return rays_; }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffU;

  scene::SceneGeometry full_;
  CasterRays rays_;
  /// Static instance of each mesh that has lost triangles, an entry of full_.instances, else kNone.
  std::vector<std::uint32_t> instance_of_mesh_;
};

}  // namespace emit::renderer
