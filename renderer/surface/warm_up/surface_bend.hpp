// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "surface/model/drive_sensitivity.hpp"
#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Error in temperature that simplification causes: the surface as loaded faces elsewhere than the
/// normals at the corners of a triangle say, so that it receives another share of sun and sky.
/// Immutable; any thread; allocates nothing after construction.
class SurfaceBend {
 public:
  /// Keeps references: both must outlive the object.
  SurfaceBend(const SurfaceInputs& inputs, const DriveSensitivity& sensitivity)
      : in_(inputs), sensitivity_(sensitivity) {}

  /// Greatest difference in temperature at four places of a triangle, its centre and near the
  /// middles of its edges, in K. It is 0 if the mesh has lost no triangle. It is computed to first
  /// order, with the sensitivities to sun and sky.
  [[nodiscard]] float cost_k(const RefinedMesh& refined, std::uint32_t slot,
                             const SurfacePatch& patch) const;

 private:
  /// The same difference at one place, which is given by the weights of the corners.
  [[nodiscard]] float cost_at_k(const glm::vec3& weight, const RefinedMesh& refined,
                                std::uint32_t slot, const SurfacePatch& patch) const;

  const SurfaceInputs& in_;
  const DriveSensitivity& sensitivity_;
};

}  // namespace emit::renderer
