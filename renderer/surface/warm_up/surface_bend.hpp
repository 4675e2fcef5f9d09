// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "surface/model/drive_worth.hpp"
#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// What it costs that a surface, before it was simplified, faces elsewhere than the corners of a
/// triangle make believe: in the sun and under the sky that they see. Immutable; any thread;
/// allocates nothing after construction.
class SurfaceBend {
 public:
  /// Both must outlive it.
  SurfaceBend(const SurfaceInputs& inputs, const DriveWorth& worth) : in_(inputs), worth_(worth) {}

  /// Greatest difference in temperature at the triangle's centre and at the middles of its edges,
  /// K; 0 where the mesh has lost no triangle. By first-order worths of sun and sky.
  [[nodiscard]] float cost_k(const RefinedMesh& refined, std::uint32_t slot,
                             const SurfacePatch& patch) const;

 private:
  /// The same at one place: weights of the corners.
  [[nodiscard]] float cost_at_k(const glm::vec3& weight, const RefinedMesh& refined,
                                std::uint32_t slot, const SurfacePatch& patch) const;

  const SurfaceInputs& in_;
  const DriveWorth& worth_;
};

}  // namespace emit::renderer
