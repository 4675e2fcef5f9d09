// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "surface/model/surface_model.hpp"
#include "surface/rays/hot_parts.hpp"

namespace emit::renderer {

/// Traces the shares of the sun and of the sky behind entities that samples see over a record, and
/// what hot parts of entities send to them.
/// Immutable; any thread.
class SunTracer {
 public:
  /// Keeps a reference: `inputs` must outlive the tracer.
  SunTracer(const SurfaceInputs& inputs, const SurfaceModelOptions& options);

  /// Fills the visible share of the sun's disc for each interval of the record, if there are
  /// entities the share of the sky that they hide and what their hot parts send, and if there are
  /// broken clouds the sun that they leave.
  /// @pre sun_frac.size() equals the record's intervals; so do those of the others, or they are 0
  void trace(const SurfaceSample& sample, std::span<float> sun_frac,
             std::span<HiddenSky> hidden_sky, std::span<float> cloud_sun) const;

 private:
  const SurfaceInputs& in_;
  bool lateral_ = true;
  float max_blur_m_ = 0.0F;
  HotParts hot_;
  std::vector<float> foot_reach_m_;      ///< foot_reach_m() by material
  std::vector<float> diffusivity_m2_s_;  ///< diffusivity of the first layer, by material
};

}  // namespace emit::renderer
