// SPDX-License-Identifier: Apache-2.0
// Shade of entities in CachedSurface, finer than samples lie: exposure tiles hold past shade, and
// entity shadow depth maps give the present one.
#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/common.hpp>
#include <limits>

#include "emit/physics/check.hpp"
#include "surface/run/cached_surface.hpp"

namespace emit::renderer {

void CachedSurface::begin_shade(std::int64_t now_ns, const Inputs& inputs) {
  const physics::Forcing forcing =
      inputs.environment.forcing_at(now_ns, inputs.environment.sun_at(now_ns));
  // Linearise the response around a sunlit surface in the weather of now.
  constexpr double kSunlitK = 10.0;  // typical difference to the air
  shade_.emplace(
      model_->samples, model_->drawn_samples,
      ShadeResponse(heat_, materials_.size(), {forcing.film_w_m2_k, forcing.air_k + kSunlitK}),
      inputs.entities.size(), options_.history_start_ns, static_cast<float>(options_.tolerance_k));
  shade_->restart(now_ns, inputs.entities);
  shadows_.assign(inputs.entities.size(), {});
  // Make all shadow depth maps now. Frames make those anew whose entity has turned.
  place_entities(now_ns, inputs.entities);
  const glm::vec3 to_sun(inputs.environment.sun_at(now_ns).direction_enu);
  for (std::size_t m = 0; m < entities_now_.size(); ++m) {
    shadow_maps_.begin_frame();
    (void)shadow_maps_.look(m, to_sun * entities_now_[m].rel_from_body, EntityShadowMaps::kSharpRad,
                            rays(), workers_);
  }
}

void CachedSurface::place_shadows(std::int64_t drawn_ns, std::int64_t sun_ns,
                                  const Inputs& inputs) noexcept {
  EMIT_CHECK(shade_.has_value());
  place_entities(drawn_ns, inputs.entities);
  const physics::SunPosition sun = inputs.environment.sun_at(sun_ns);
  to_sun_ = glm::vec3(sun.direction_enu);
  const bool up = sun.elevation.value() > StepPlan::kMinSunElevationRad;
  stale_shadow_ = false;
  for (std::size_t m = 0; m < entities_now_.size(); ++m) {
    const EntityPlacement& entity = entities_now_[m];
    const float diagonal_m = shadow_maps_.diagonal_m(m);
    Shadow& shadow = shadows_[m];
    shadow.on = up && entity.on && diagonal_m > 0.0F;
    if (!shadow.on) continue;
    // Find the end of the shadow: the lowest surface behind the entity, and a little lower. Without
    // any surface the shadow ends after some diagonals.
    constexpr float kFarDiagonals = 20.0F;
    constexpr float kLowerDiagonals = 0.25F;
    std::array<CasterRay, 9> behind;
    std::ranges::copy(shadow_maps_.corners_m(m, entity), shadow.hull_m.begin());
    for (std::size_t i = 0; i < 8; ++i) behind[i] = {shadow.hull_m[i], -to_sun_};
    behind[8] = {shadow_maps_.middle_m(m, entity), -to_sun_};
    std::array<CasterHit, behind.size()> hits;
    const std::uint32_t met = rays().first_hits(behind, {true, {}}, hits);
    float end_m = behind[8].origin_m.z - kFarDiagonals * diagonal_m * to_sun_.z;
    if (met != 0) {
      end_m = std::numeric_limits<float>::infinity();
      for (std::size_t i = 0; i < behind.size(); ++i) {
        if (((met >> i) & 1U) == 0) continue;
        end_m = std::min(end_m, behind[i].origin_m.z - hits[i].distance_m * to_sun_.z);
      }
    }
    end_m -= kLowerDiagonals * diagonal_m;
    // Bound the corners' shadows at that height, widened by the penumbra.
    glm::vec2 low_m(std::numeric_limits<float>::infinity());
    glm::vec2 high_m = -low_m;
    float farthest_m = 0.0F;
    for (std::size_t i = 0; i < 8; ++i) {
      const float way_m = std::max(0.0F, (shadow.hull_m[i].z - end_m) / to_sun_.z);
      const glm::vec2 at_m = glm::vec2(shadow.hull_m[i]) - way_m * glm::vec2(to_sun_);
      low_m = glm::min(low_m, at_m);
      high_m = glm::max(high_m, at_m);
      farthest_m = std::max(farthest_m, way_m);
    }
    const float rim_m = shadow_maps_.rim_m(m, farthest_m) / to_sun_.z;
    low_m -= rim_m;
    high_m += rim_m;
    // Add the corners of that rectangle to those of the box.
    shadow.hull_m[8] = {low_m, end_m};
    shadow.hull_m[9] = {high_m, end_m};
    shadow.hull_m[10] = {low_m.x, high_m.y, end_m};
    shadow.hull_m[11] = {high_m.x, low_m.y, end_m};
  }
}

PlacedShadowMap CachedSurface::cast_shadow(std::size_t entity) noexcept {
  EMIT_CHECK(entity < shadows_.size() && shadows_[entity].on);
  const EntityPlacement& now = entities_now_[entity];
  if (!shadow_maps_.look(entity, to_sun_ * now.rel_from_body, EntityShadowMaps::kSharpRad, rays(),
                         workers_)) {
    stale_shadow_ = true;
  }
  return shadow_maps_.place(entity, now, to_sun_);
}

}  // namespace emit::renderer
