// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/sun_tracer.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "surface/columns/surface_columns.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {

SunTracer::SunTracer(const SurfaceInputs& inputs, const SurfaceModelOptions& options)
    : in_(inputs), lateral_(options.lateral), max_blur_m_(static_cast<float>(options.max_blur_m)) {
  if (options.exchange) hot_ = HotParts(inputs.geometry, inputs.entity_of_object);
  for (const scene::Material& material : inputs.materials) {
    diffusivity_m2_s_.push_back(static_cast<float>(diffusivity_m2_s(material)));
    foot_reach_m_.push_back(foot_reach_m(material));
  }
}

void SunTracer::trace(const SurfaceSample& sample, std::span<float> sun_frac,
                      std::span<HiddenSky> hidden_sky, std::span<float> cloud_sun) const {
  const HistoryRecord& record = in_.record;
  EMIT_DCHECK_OP(sun_frac.size(), ==, record.size());
  EMIT_DCHECK(hidden_sky.empty() || hidden_sky.size() == record.size());
  EMIT_DCHECK(cloud_sun.empty() || cloud_sun.size() == record.size());
  const RayOffsets offsets = ray_offsets(sample.position_m, sample.facet_m);
  // Limit the blur to half of the way over which the surface is a plane: rays must not start beyond
  // an edge. Near the foot of a solid the cells of columns conduct instead.
  const bool blurs = lateral_ && !(sample.foot_m < foot_reach_m_[sample.material]);
  const float max_blur_m = blurs ? std::min(max_blur_m_, 0.5F * sample.flat_m) : 0.0F;
  for (std::size_t i = 0; i < record.size(); ++i) {
    // Spread the starts of the rays as far as lateral conduction has blurred the edge of a shadow
    // since then (physics.md eq. 21).
    const IntervalRays& rays = record.rays[i];
    const float blur_m = std::min(
        max_blur_m, std::sqrt(2.0F * diffusivity_m2_s_[sample.material] * record.lag_s[i]));
    sun_frac[i] = rays.sun_frac(in_.rays, sample, offsets.sun_m, blur_m);
    if (!hidden_sky.empty()) {
      hidden_sky[i] = rays.hidden_sky(in_.rays, sample, offsets.around_m);
      if (!hot_.empty() && sample.entity < 0) {
        // Parts of entities that stand send the same as in the interval before.
        hidden_sky[i].hot_w_m2 =
            i > 0 && hot_.same(record.rays[i - 1], rays)
                ? hidden_sky[i - 1].hot_w_m2
                : hot_.on_w_m2(in_.rays, rays, sample.position_m + offsets.around_m * sample.normal,
                               sample.normal);
      }
    }
    if (!cloud_sun.empty()) cloud_sun[i] = rays.cloud_sun(sample);
  }
}

}  // namespace emit::renderer
