// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/view_of_now.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace emit::renderer {

float sky_past_hull(const SurfaceSample& sample, const glm::vec3& up_body) noexcept {
  const float sky_frac = 0.5F * sample.hull_open_frac + glm::dot(sample.hull_tilt_frac, up_body);
  return std::clamp(sky_frac, 0.0F, sample.hull_open_frac);
}

ViewOfNow view_of_now(const SurfaceSamples& all, const SurfaceSample& sample,
                      const EntityStand& stand) noexcept {
  const float p = stand.moved_frac;
  if (p == 0.0F) {
    return {sample.sky_frac, sample.far_frac, sample.sphere_sky_frac, sample.seen_scale,
            sample.seen_scale};
  }
  // Sum the weights of what is seen of the own hull and of other bodies.
  float own_frac = 0.0F;
  float others_frac = 0.0F;
  for (std::uint32_t k = 0; k < sample.seen_count; ++k) {
    const SeenSample& seen = all.seen[sample.first_seen + k];
    (all.samples[seen.sample].entity == sample.entity ? own_frac : others_frac) +=
        sample.seen_scale * seen.weight_frac;
  }
  ViewOfNow view;
  const auto mean = [p](float before, float now) { return (1.0F - p) * before + p * now; };
  view.sky_frac = mean(sample.sky_frac, sky_past_hull(sample, stand.up_body));
  // Scale the sphere's share with that of the hemisphere: they agree on open level, upright and
  // inverted faces.
  view.sphere_sky_frac =
      std::clamp(sample.sphere_sky_frac + 0.5F * (view.sky_frac - sample.sky_frac), 0.0F, 1.0F);
  // Let the own hull keep its share, and the surroundings take that of the others.
  const float own_now_frac = own_frac > 0.0F ? mean(own_frac, 1.0F - sample.hull_open_frac) : 0.0F;
  view.own_scale = own_frac > 0.0F ? sample.seen_scale * own_now_frac / own_frac : 0.0F;
  view.others_scale = (1.0F - p) * sample.seen_scale;
  view.far_frac = std::max(0.0F, 1.0F - view.sky_frac - own_now_frac - (1.0F - p) * others_frac);
  return view;
}

}  // namespace emit::renderer
