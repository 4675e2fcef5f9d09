// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/entity_shadows.hpp"

#include <algorithm>
#include <glm/common.hpp>
#include <limits>

#include "emit/physics/check.hpp"
#include "history/step_plan.hpp"

namespace emit::renderer {

EntityShadows::EntityShadows(std::span<const scene::Aabb> bounds_m, float highest_static_m)
    : maps_(bounds_m),
      highest_static_m_(highest_static_m),
      placements_(bounds_m.size()),
      shadows_(bounds_m.size()) {}

void EntityShadows::begin(std::int64_t now_ns, const Environment& environment,
                          std::span<const PoseHistory> entities, const CasterRays& rays,
                          threads::WorkerPool& workers) {
  EMIT_CHECK_OP(entities.size(), ==, placements_.size());
  shadows_.assign(entities.size(), {});
  const glm::vec3 to_sun(environment.sun_at(now_ns).direction_enu);
  for (std::size_t m = 0; m < entities.size(); ++m) {
    placements_[m] = placement_of(entities[m].at(now_ns), rays.origin_world_m());
    maps_.begin_frame();
    (void)maps_.look(m, to_sun * placements_[m].rel_from_body, EntityShadowMaps::kSharpRad, rays,
                     workers);
  }
}

float EntityShadows::end_height_m(std::size_t entity, std::span<const glm::vec3, 8> corners_m,
                                  const CasterRays& rays) const noexcept {
  // The shadow ends after some diagonals if it meets no surface.
  constexpr float kFarDiagonals = 20.0F;
  constexpr float kLowerDiagonals = 0.25F;
  const float diagonal_m = maps_.diagonal_m(entity);
  // Send rays away from the sun from all corners and from the middle.
  std::array<CasterRay, 9> behind;
  for (std::size_t i = 0; i < 8; ++i) behind[i] = {corners_m[i], -to_sun_};
  behind[8] = {maps_.middle_m(entity, placements_[entity]), -to_sun_};
  std::array<CasterHit, behind.size()> hits;
  const std::uint32_t met = rays.first_hits(behind, {true, {}}, hits);
  float end_m = behind[8].origin_m.z - kFarDiagonals * diagonal_m * to_sun_.z;
  if (met != 0) {
    end_m = std::numeric_limits<float>::infinity();
    for (std::size_t i = 0; i < behind.size(); ++i) {
      if (((met >> i) & 1U) == 0) continue;
      end_m = std::min(end_m, behind[i].origin_m.z - hits[i].distance_m * to_sun_.z);
    }
  }
  return end_m - kLowerDiagonals * diagonal_m;
}

std::array<glm::vec3, 4> EntityShadows::rectangle_at(std::size_t entity,
                                                     std::span<const glm::vec3, 8> corners_m,
                                                     float at_m) const noexcept {
  // Bound the corners' shadows at that height, widened by the penumbra.
  glm::vec2 low_m(std::numeric_limits<float>::infinity());
  glm::vec2 high_m = -low_m;
  float farthest_m = 0.0F;
  for (const glm::vec3& corner_m : corners_m) {
    const float way_m = std::max(0.0F, (corner_m.z - at_m) / to_sun_.z);
    const glm::vec2 place_m = glm::vec2(corner_m) - way_m * glm::vec2(to_sun_);
    low_m = glm::min(low_m, place_m);
    high_m = glm::max(high_m, place_m);
    farthest_m = std::max(farthest_m, way_m);
  }
  const float rim_m = maps_.rim_m(entity, farthest_m) / to_sun_.z;
  low_m -= rim_m;
  high_m += rim_m;
  return {glm::vec3(low_m, at_m), glm::vec3(high_m, at_m), glm::vec3(low_m.x, high_m.y, at_m),
          glm::vec3(high_m.x, low_m.y, at_m)};
}

void EntityShadows::place(std::int64_t drawn_ns, std::int64_t sun_ns,
                          const Environment& environment, std::span<const PoseHistory> entities,
                          const CasterRays& rays) noexcept {
  EMIT_CHECK_OP(entities.size(), ==, shadows_.size());
  const physics::SunPosition sun = environment.sun_at(sun_ns);
  to_sun_ = glm::vec3(sun.direction_enu);
  const bool up = sun.elevation.value() > StepPlan::kMinSunElevationRad;
  stale_ = false;
  for (std::size_t m = 0; m < entities.size(); ++m) {
    placements_[m] = placement_of(entities[m].at(drawn_ns), rays.origin_world_m());
    Shadow& shadow = shadows_[m];
    shadow.on = up && placements_[m].on && maps_.diagonal_m(m) > 0.0F;
    if (!shadow.on) continue;
    const std::array<glm::vec3, 8> corners_m = maps_.corners_m(m, placements_[m]);
    const float end_m = end_height_m(m, corners_m, rays);
    std::ranges::copy(rectangle_at(m, corners_m, end_m), shadow.hull_m.begin() + 8);
    // Begin at the highest surface that can take shade. The mesh that is drawn may lie higher than
    // the surface as loaded, by a share of a pixel.
    constexpr float kHigherDiagonals = 0.25F;
    const float top_m = highest_static_m_ + kHigherDiagonals * maps_.diagonal_m(m);
    const bool above = std::ranges::all_of(
        corners_m, [top_m](const glm::vec3& corner_m) { return corner_m.z > top_m; });
    if (!above) {
      std::ranges::copy(corners_m, shadow.hull_m.begin());
      continue;
    }
    shadow.on = end_m < top_m;
    if (!shadow.on) continue;
    const std::array<glm::vec3, 4> top = rectangle_at(m, corners_m, top_m);
    std::ranges::copy(top, shadow.hull_m.begin());
    std::ranges::copy(top, shadow.hull_m.begin() + 4);
  }
}

PlacedShadowMap EntityShadows::cast(std::size_t entity, const CasterRays& rays,
                                    threads::WorkerPool& workers) noexcept {
  EMIT_CHECK(entity < shadows_.size() && shadows_[entity].on);
  const EntityPlacement& now = placements_[entity];
  if (!maps_.look(entity, to_sun_ * now.rel_from_body, EntityShadowMaps::kSharpRad, rays,
                  workers)) {
    stale_ = true;
  }
  return maps_.place(entity, now, to_sun_);
}

}  // namespace emit::renderer
