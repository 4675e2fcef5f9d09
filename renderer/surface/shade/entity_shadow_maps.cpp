// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/entity_shadow_maps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/mesh/tangents.hpp"

namespace emit::renderer {
namespace {

/// Mark in Map::around_m of a texel that has both open and filled texels around it.
constexpr float kMixedM = -1e30F;
/// Width of the empty rim around the entity, in texels.
constexpr float kRim = 2.0F;

/// Corners of a box.
std::array<glm::vec3, 8> corners(const scene::Aabb& box) noexcept {
  std::array<glm::vec3, 8> out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = glm::vec3((i & 1U) != 0U ? box.max_m.x : box.min_m.x,
                       (i & 2U) != 0U ? box.max_m.y : box.min_m.y,
                       (i & 4U) != 0U ? box.max_m.z : box.min_m.z);
  }
  return out;
}

/// Positions of the taps in the unit disc, the same as in the shader.
const std::array<glm::vec2, EMIT_SHADE_TAPS>& taps() noexcept {
  static const auto kTaps = [] {
    std::array<glm::vec2, EMIT_SHADE_TAPS> out;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const auto [x, y] = shade_tap(static_cast<std::uint32_t>(i));
      out[i] = {x, y};
    }
    return out;
  }();
  return kTaps;
}

/// Point of the level plane on the sun's ray through a place on the map. Solves column(p) = column
/// and row(p) = row for x and y by Cramer's rule.
glm::vec2 on_plane(const PlacedShadowMap& shadow_map, float column, float row,
                   float plane_m) noexcept {
  const glm::vec4& c = shadow_map.column;
  const glm::vec4& r = shadow_map.row;
  const float right_c = column - c.z * plane_m - c.w;
  const float right_r = row - r.z * plane_m - r.w;
  const float determinant = c.x * r.y - c.y * r.x;
  return {(right_c * r.y - c.y * right_r) / determinant,
          (c.x * right_r - right_c * r.x) / determinant};
}

}  // namespace

EntityShadowMaps::EntityShadowMaps(std::span<const scene::Aabb> bounds_m)
    : alone_(bounds_m.size()) {
  for (EntityPlacement& placement : alone_) placement.on = false;
  for (const scene::Aabb& box : bounds_m) {
    Map& map = maps_.emplace_back();
    map.box_m = box;
    map.depth_m.assign(std::size_t{kSide} * kSide, kOpenM);
    map.around_m.assign(std::size_t{kSide} * kSide, kOpenM);
  }
  // Make the table of taps now, because the first use must not be in a frame.
  (void)taps();
}

bool EntityShadowMaps::look(std::size_t entity, const glm::vec3& to_sun_body, float most_turn_rad,
                            const CasterRays& rays, threads::WorkerPool& workers) noexcept {
  // Keep the map if it still fits, or if the frame may make no more of them.
  Map& map = maps_[entity];
  const float turned_rad = glm::distance(map.to_sun, to_sun_body);
  if (map.box_m.empty() || turned_rad < most_turn_rad) return true;
  constexpr float kStale = 10.0F;
  if (looks_left_ == 0) return turned_rad < kStale * most_turn_rad;
  --looks_left_;
  map.to_sun = to_sun_body;
  // Count the revision, so that the device gets the new map.
  ++map.revision;
  // Lay the map across the direction of the sun, around the projected box.
  const Tangents tangents = tangents_of(to_sun_body);
  map.across = tangents.u;
  map.along = tangents.v;
  glm::vec2 low_m(std::numeric_limits<float>::infinity());
  glm::vec2 high_m = -low_m;
  float deepest_m = -std::numeric_limits<float>::infinity();
  for (const glm::vec3& corner_m : corners(map.box_m)) {
    const glm::vec2 at_m(glm::dot(map.across, corner_m), glm::dot(map.along, corner_m));
    low_m = glm::min(low_m, at_m);
    high_m = glm::max(high_m, at_m);
    deepest_m = std::max(deepest_m, -glm::dot(to_sun_body, corner_m));
  }
  const glm::vec2 size_m = high_m - low_m;
  map.texel_m = std::max({size_m.x, size_m.y, 1e-3F}) / (kSide - 2.0F * kRim);
  map.corner_m = 0.5F * (low_m + high_m) - 0.5F * kSide * map.texel_m;
  map.half = 0.5F * size_m / map.texel_m + kRim;

  // Trace each texel from behind the entity towards the sun: the first hit is the deepest surface.
  const float start_m = deepest_m + map.texel_m;
  alone_[entity].on = true;
  const CasterSelection only{false, std::span(alone_).first(entity + 1)};
  workers.run(kSide, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (std::size_t first = 0; first < kSide; first += CasterRays::kMaxRays) {
        std::array<CasterRay, CasterRays::kMaxRays> sent;
        std::array<CasterHit, CasterRays::kMaxRays> hits;
        // Begin at the plane behind the deepest corner of the box, at the centre of each texel.
        for (std::size_t k = 0; k < sent.size(); ++k) {
          const glm::vec2 at_m =
              map.corner_m + map.texel_m * (glm::vec2(first + k, row) + glm::vec2(0.5F));
          sent[k] = {at_m.x * map.across + at_m.y * map.along - start_m * to_sun_body, to_sun_body};
        }
        const std::uint32_t hit = rays.first_hits(sent, only, hits);
        for (std::size_t k = 0; k < sent.size(); ++k) {
          map.depth_m[row * kSide + first + k] =
              ((hit >> k) & 1U) != 0U ? start_m - hits[k].distance_m : kOpenM;
        }
      }
    }
  });
  alone_[entity].on = false;
  // Find the mean depth of the filled texels.
  double sum_m = 0.0;
  std::size_t count = 0;
  for (const float depth_m : map.depth_m) {
    if (depth_m >= kOpenM) continue;
    sum_m += static_cast<double>(depth_m);
    ++count;
  }
  look_around(map);
  map.mean_m = count > 0 ? static_cast<float>(sum_m / static_cast<double>(count)) : 0.0F;
  return true;
}

void EntityShadowMaps::look_around(Map& map) noexcept {
  constexpr auto kEnd = static_cast<int>(kSide);
  for (int y = 0; y < kEnd; ++y) {
    for (int x = 0; x < kEnd; ++x) {
      // Count the open texels of this 3 x 3 square, and find its deepest filled one.
      int open = 0;
      float deepest_m = -kOpenM;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int column = x + dx;
          const int row = y + dy;
          const bool inside = column >= 0 && row >= 0 && column < kEnd && row < kEnd;
          const float depth_m =
              inside ? map.depth_m[static_cast<std::size_t>(row * kEnd + column)] : kOpenM;
          if (depth_m >= kOpenM) {
            ++open;
          } else {
            deepest_m = std::max(deepest_m, depth_m);
          }
        }
      }
      float& around_m = map.around_m[static_cast<std::size_t>(y * kEnd + x)];
      around_m = open == 9 ? kOpenM : open > 0 ? kMixedM : deepest_m;
    }
  }
}

PlacedShadowMap EntityShadowMaps::place(std::size_t entity, const EntityPlacement& placement,
                                        const glm::vec3& to_sun) const noexcept {
  const Map& map = maps_[entity];
  EMIT_DCHECK(map.box_m.empty() || map.revision > 0);
  const auto line = [&](const glm::vec3& axis_body, float scale, float origin) {
    const glm::vec3 axis = placement.rel_from_body * axis_body;
    return glm::vec4(scale * axis, origin - scale * glm::dot(axis, placement.position_m));
  };
  // Turn the map's axes into rel axes and scale them to texels.
  const float per_m = 1.0F / map.texel_m;
  PlacedShadowMap placed{line(map.across, per_m, -map.corner_m.x * per_m),
                         line(map.along, per_m, -map.corner_m.y * per_m),
                         line(-map.to_sun, 1.0F, 0.0F),
                         map.mean_m,
                         map.texel_m,
                         map.half};
  // Shear the map if the entity has turned a little since: rays must go to the sun of now, through
  // the places that they have at the entity's mean depth.
  const glm::vec4 aside = (placed.depth_m - glm::vec4(0.0F, 0.0F, 0.0F, map.mean_m)) /
                          glm::dot(glm::vec3(placed.depth_m), to_sun);
  placed.column -= glm::dot(glm::vec3(placed.column), to_sun) * aside;
  placed.row -= glm::dot(glm::vec3(placed.row), to_sun) * aside;
  return placed;
}

float EntityShadowMaps::shaded_frac(std::size_t entity, float column, float row, float depth_m,
                                    float radius_texels, std::uint32_t first,
                                    std::uint32_t stride) const noexcept {
  const std::vector<float>& depths_m = maps_[entity].depth_m;
  constexpr auto kWidth = static_cast<float>(kSide);
  // Return early if the whole disc lies outside the map.
  if (column < -radius_texels || row < -radius_texels || column >= kWidth + radius_texels ||
      row >= kWidth + radius_texels) {
    return 0.0F;
  }
  // Skip the taps if the texels around a small disc agree that all of it is open or shaded.
  if (radius_texels <= kAround && column >= 0.0F && row >= 0.0F && column < kWidth &&
      row < kWidth) {
    const float around_m =
        maps_[entity]
            .around_m[static_cast<std::size_t>(row) * kSide + static_cast<std::size_t>(column)];
    if (around_m >= kOpenM) return 0.0F;
    if (around_m > kMixedM && depth_m > around_m + EMIT_SHADE_LIFT_M) {
      return 1.0F / static_cast<float>(stride);
    }
  }
  // Count the taps that lie in the shade.
  int shaded = 0;
  for (std::size_t i = first; i < EMIT_SHADE_TAPS; i += stride) {
    const glm::vec2& tap = taps()[i];
    const auto x = static_cast<int>(std::floor(column + radius_texels * tap.x));
    const auto y = static_cast<int>(std::floor(row + radius_texels * tap.y));
    constexpr auto kEnd = static_cast<int>(kSide);
    if (x < 0 || y < 0 || x >= kEnd || y >= kEnd) continue;
    if (depth_m > depths_m[static_cast<std::size_t>(y * kEnd + x)] + EMIT_SHADE_LIFT_M) ++shaded;
  }
  return static_cast<float>(shaded) / EMIT_SHADE_TAPS;
}

float EntityShadowMaps::caster_m(std::size_t entity, float column, float row) const noexcept {
  const Map& map = maps_[entity];
  constexpr float kLast = static_cast<float>(kSide) - 1.0F;
  const float depth_m = map.depth_m[static_cast<std::size_t>(std::clamp(row, 0.0F, kLast)) * kSide +
                                    static_cast<std::size_t>(std::clamp(column, 0.0F, kLast))];
  return depth_m < kOpenM ? depth_m : map.mean_m;
}

float EntityShadowMaps::diagonal_m(std::size_t entity) const noexcept {
  const scene::Aabb& box_m = maps_[entity].box_m;
  return box_m.empty() ? 0.0F : static_cast<float>(glm::distance(box_m.min_m, box_m.max_m));
}

float EntityShadowMaps::rim_m(std::size_t entity, float way_m) const noexcept {
  static const auto kTangent = static_cast<float>(std::tan(physics::kSunSemiAngleRad));
  // Use the diagonal, because no turn of the box makes texels wider.
  return way_m * kTangent + diagonal_m(entity) * (kRim + 1.0F) / kSide;
}

glm::vec3 EntityShadowMaps::middle_m(std::size_t entity,
                                     const EntityPlacement& placement) const noexcept {
  const scene::Aabb& box_m = maps_[entity].box_m;
  return placement.rel_from_body * glm::vec3(0.5 * (box_m.min_m + box_m.max_m)) +
         placement.position_m;
}

std::array<glm::vec3, 8> EntityShadowMaps::corners_m(
    std::size_t entity, const EntityPlacement& placement) const noexcept {
  std::array<glm::vec3, 8> out = corners(maps_[entity].box_m);
  for (glm::vec3& corner_m : out) {
    corner_m = placement.rel_from_body * corner_m + placement.position_m;
  }
  return out;
}

float EntityShadowMaps::top_m(std::size_t entity, const EntityPlacement& placement) const noexcept {
  float top_m = -std::numeric_limits<float>::infinity();
  for (const glm::vec3& corner_m : corners(maps_[entity].box_m)) {
    top_m = std::max(top_m, (placement.rel_from_body * corner_m).z);
  }
  return top_m;
}

float penumbra_texels(const PlacedShadowMap& shadow_map, float depth_m) noexcept {
  static const auto kTangent = static_cast<float>(std::tan(physics::kSunSemiAngleRad));
  constexpr float kLeast = 0.5F;
  return std::max(kLeast, (depth_m - shadow_map.mean_m) * kTangent / shadow_map.texel_m);
}

ShadedBox shaded_box(const PlacedShadowMap& shadow_map, float plane_m) noexcept {
  constexpr auto kEnd = static_cast<float>(EntityShadowMaps::kSide);
  // Find the depth of the shadow's middle on the plane, which gives the width of the penumbra.
  const glm::vec2 middle_m = on_plane(shadow_map, 0.5F * kEnd, 0.5F * kEnd, plane_m);
  const float depth_m = glm::dot(shadow_map.depth_m, glm::vec4(middle_m, plane_m, 1.0F));
  const float rim = penumbra_texels(shadow_map, depth_m);
  // Bound the corners of the filled part of the map, widened by the penumbra.
  ShadedBox box{middle_m, middle_m};
  const glm::vec2 half = shadow_map.half + rim;
  for (const float column : {0.5F * kEnd - half.x, 0.5F * kEnd + half.x}) {
    for (const float row : {0.5F * kEnd - half.y, 0.5F * kEnd + half.y}) {
      const glm::vec2 at_m = on_plane(shadow_map, column, row, plane_m);
      box.low_m = glm::min(box.low_m, at_m);
      box.high_m = glm::max(box.high_m, at_m);
    }
  }
  return box;
}

}  // namespace emit::renderer
