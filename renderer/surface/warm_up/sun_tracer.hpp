// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "surface/model/surface_model.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {

/// Traces what samples see of the sun and of the sky behind entities over a record. Immutable; any
/// thread.
class SunTracer {
 public:
  /// `inputs` must outlive it.
  SunTracer(const SurfaceInputs& inputs, const SurfaceModelOptions& options);

  /// Fills the visible share of the sun's disc and, where there are entities, the share of the sky
  /// that they hide, interval by interval.
  /// @pre sun_frac.size() equals the record's intervals; so does hidden_sky.size(), or it is 0
  void trace(const SurfaceSample& sample, std::span<float> sun_frac,
             std::span<HiddenSky> hidden_sky) const;

  /// Distances of ray starts from the surface at a place, which is in the body frame of an entity
  /// where `mover` is not negative.
  [[nodiscard]] RayOffsets offsets(const glm::vec3& place_m, std::int32_t mover) const noexcept;
  [[nodiscard]] const RayOffsets& bulk_offsets() const noexcept { return offsets_; }

 private:
  const SurfaceInputs& in_;
  RayOffsets offsets_;
  bool lateral_ = true;
  float max_blur_m_ = 0.0F;
  std::vector<float> diffusivity_m2_s_;  ///< by material, of its first layer
};

}  // namespace emit::renderer
