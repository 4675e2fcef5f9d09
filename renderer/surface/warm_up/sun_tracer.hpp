// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "surface/model/surface_model.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {

/// Traces the shares of the sun and of the sky behind entities that samples see over a record.
/// Immutable; any thread.
class SunTracer {
 public:
  /// Keeps a reference: `inputs` must outlive the tracer.
  SunTracer(const SurfaceInputs& inputs, const SurfaceModelOptions& options);

  /// Fills the visible share of the sun's disc for each interval of the record and, if there are
  /// entities, the share of the sky that they hide.
  /// @pre sun_frac.size() equals the record's intervals; so does hidden_sky.size(), or it is 0
  void trace(const SurfaceSample& sample, std::span<float> sun_frac,
             std::span<HiddenSky> hidden_sky) const;

  /// Distances of the starts of rays from the surface at a place. If `entity` is not negative, the
  /// place is in the body frame of that entity.
  [[nodiscard]] RayOffsets offsets(const glm::vec3& place_m, std::int32_t entity) const noexcept;
  /// Distances that hold for the bulk of the scene.
  [[nodiscard]] const RayOffsets& bulk_offsets() const noexcept { return offsets_; }

 private:
  const SurfaceInputs& in_;
  RayOffsets offsets_;
  bool lateral_ = true;
  float max_blur_m_ = 0.0F;
  std::vector<float> diffusivity_m2_s_;  ///< diffusivity of the first layer, by material
};

}  // namespace emit::renderer
