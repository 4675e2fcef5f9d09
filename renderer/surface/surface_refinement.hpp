// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "surface/surface_bend.hpp"
#include "surface/surface_patch.hpp"

namespace emit::renderer {

/// Decides which triangles are too coarse. A triangle is halved
/// - where a caster's shade may fall on it, or it sees a caster fill much of its sky, and it is
///   larger than a part of that caster: so that no shadow slips between its corners;
/// - where its newest vertex is not what its parents interpolate to: the error of a linear
///   triangle is a quarter of its parent's;
/// - near edges and feet of bodies, where heat moves along the surface;
/// - where sunlight fell on its corners unequally of late: an edge of a shadow runs through.
/// It is never halved below some pixels at the nearest place of the camera (one pixel where an edge
/// runs: of a shadow, or between temperatures far apart), and only for the first reason where no
/// place of the camera sees it.
class SurfaceRefinement {
 public:
  SurfaceRefinement(const SurfaceInputs& inputs, const RefineView& view,
                    const SurfaceModelOptions& options);

  /// Slots of the mesh's leaves to halve; patches of other meshes are not looked at.
  void flag(std::uint32_t mesh, const RefinedMesh& refined, std::span<const SurfacePatch> patches,
            std::vector<std::uint32_t>& slots) const;

 private:
  /// One instance at one interval of the record.
  struct Caster {
    glm::vec3 centre_m{0.0F};
    glm::vec3 to_sun{0.0F};
    float radius_m = 0.0F;
    float width_m = 0.0F;
  };
  [[nodiscard]] bool too_coarse(const RefinedMesh& refined, std::uint32_t slot,
                                const SurfacePatch& patch) const;
  [[nodiscard]] bool seen(const std::array<glm::vec3, 3>& corners_m, const RefinedMesh& refined,
                          std::uint32_t slot, const SurfacePatch& patch) const;
  [[nodiscard]] float pixel_m(const glm::vec3& centre_m) const noexcept;
  /// Size a triangle may have there without missing a caster's shade.
  [[nodiscard]] float seed_edge_m(const glm::vec3& centre_m, float longest_m) const noexcept;

  const SurfaceInputs& in_;
  SurfaceBend bend_;
  std::vector<glm::vec3> eyes_rel_m_;
  float pixel_rad_ = 1e-3F;
  float tolerance_k_ = 0.1F;
  bool lateral_ = true;
  std::vector<float> diffusivity_m2_s_;  ///< by material
  std::vector<Caster> casters_;
  std::size_t recent_ = 0;  ///< first of the intervals that count as lately
};

}  // namespace emit::renderer
