// SPDX-License-Identifier: Apache-2.0
#include "surface/surface_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "surface/parallel.hpp"

namespace emit::renderer {
namespace {

/// Share of a caster's width that a triangle in its shade may have.
constexpr float kSeedFrac = 0.25F;
/// Edges of shadows this young are still sharp.
constexpr float kRecentS = 900.0F;
/// Corners on which that much more of the sun's flux falls than on others have the edge of a shadow
/// between them.
constexpr float kEdgeSunFrac = 0.2F;
/// Down to so many pixels that alone is reason to cut; finer, only what interpolation gets wrong.
constexpr float kEdgeSunPx = 4.0F;
/// Triangles of up to so many pixels are tested for being seen at all: by their corners and centre,
/// which is too little for larger ones.
constexpr float kTestedPx = 8.0F;
/// A triangle that turns its back to an eye by more than this sine is not seen from there, whatever
/// curvature its vertices' normals stand for.
constexpr float kBackSine = 0.2F;
/// Share of the way to a point that must be free.
constexpr float kSeenFrac = 0.999F;
/// How far the newest vertex may lie from what its parents interpolate to, in tolerances: a
/// triangle's own error is about half of that. Where triangles are large, and where they are down
/// to some pixels.
constexpr float kSurplusFrac = 1.2F;
constexpr float kSharpSurplusFrac = 8.0F;
/// Samples lie as close as heat gets in this time, up to so many such depths from an edge.
constexpr float kCreaseS = 1000.0F;
constexpr float kCreaseDepths = 3.0F;
/// What facing elsewhere may cost in the middle of a triangle or of an edge, in tolerances: where
/// triangles are large, and where they are down to some pixels.
constexpr float kBendFrac = 1.0F;
constexpr float kSharpBendFrac = 4.0F;
/// The shortest edges that are halved, in pixels: where temperature is smooth, and where an edge
/// runs (finer ones change no pixel by more than a tenth of a kelvin, emit bench
/// error-vs-time).
constexpr float kLeastEdgePx = 2.5F;
constexpr float kLeastShadowEdgePx = 0.9F;

}  // namespace

SurfaceRefinement::SurfaceRefinement(const SurfaceInputs& inputs, const RefineView& view,
                                     const SurfaceModelOptions& options)
    : in_(inputs),
      bend_(inputs),
      pixel_rad_(static_cast<float>(view.pixel_rad)),
      tolerance_k_(static_cast<float>(options.tolerance_k)),
      lateral_(options.lateral) {
  for (const scene::Material& material : inputs.materials) {
    diffusivity_m2_s_.push_back(static_cast<float>(diffusivity_m2_s(material)));
  }
  for (const glm::dvec3& eye : view.eyes_world_m) {
    eyes_rel_m_.emplace_back(eye - inputs.rays.origin_world_m());
  }
  const HistoryRecord& record = inputs.record;
  recent_ = record.size() - 1;
  while (recent_ > 0 && record.lag_s[recent_ - 1] < kRecentS) --recent_;
  for (const scene::Instance& instance : inputs.geometry.instances) {
    if (instance.world_bounds.empty()) continue;
    glm::dvec3 size_m = instance.world_bounds.max_m - instance.world_bounds.min_m;
    std::array<double, 3> sorted = {size_m.x, size_m.y, size_m.z};
    std::ranges::sort(sorted);
    const glm::dvec3 centre_m = 0.5 * (instance.world_bounds.max_m + instance.world_bounds.min_m);
    Caster caster;
    caster.radius_m = static_cast<float>(0.5 * glm::length(size_m));
    caster.width_m = static_cast<float>(sorted[1]);
    const std::int32_t mover = inputs.mover_of_object[instance.object];
    if (mover < 0) {
      caster.centre_m = glm::vec3(centre_m - inputs.rays.origin_world_m());
      for (std::size_t i = 0; i < record.size(); ++i) {
        if (!record.rays[i].sun_up()) continue;
        caster.to_sun = record.rays[i].to_sun();
        casters_.push_back(caster);
      }
      continue;
    }
    for (std::size_t i = 0; i < record.size(); ++i) {
      const MoverPlacement& place = record.rays[i].placement(static_cast<std::size_t>(mover));
      if (!record.rays[i].sun_up() || !place.on) continue;
      caster.centre_m = place.position_m;
      caster.to_sun = record.rays[i].to_sun();
      casters_.push_back(caster);
    }
  }
}

float SurfaceRefinement::pixel_m(const glm::vec3& centre_m) const noexcept {
  float distance_m = 1e30F;
  for (const glm::vec3& eye : eyes_rel_m_) {
    distance_m = std::min(distance_m, glm::distance(eye, centre_m));
  }
  return eyes_rel_m_.empty() ? 0.0F : pixel_rad_ * distance_m;
}

float SurfaceRefinement::seed_edge_m(const glm::vec3& centre_m, float longest_m) const noexcept {
  float seed_m = 1e30F;
  for (const Caster& caster : casters_) {
    const float edge_m = kSeedFrac * caster.width_m;
    if (edge_m >= std::min(seed_m, longest_m)) continue;  // changes nothing
    const glm::vec3 way = centre_m - caster.centre_m;
    const float along_m = std::max(0.0F, -glm::dot(way, caster.to_sun));
    const float beside_m = glm::length(way + along_m * caster.to_sun);
    if (beside_m < caster.radius_m + longest_m) seed_m = edge_m;
  }
  return seed_m;
}

bool SurfaceRefinement::seen(const std::array<glm::vec3, 3>& corners_m, const RefinedMesh& refined,
                             std::uint32_t slot, const SurfacePatch& patch) const {
  if (eyes_rel_m_.empty() || patch.mover >= 0) return true;
  const glm::vec3 centre_m = (corners_m[0] + corners_m[1] + corners_m[2]) / 3.0F;
  const glm::vec3 across = glm::cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0]);
  const float area = glm::length(across);
  if (!(area > 0.0F)) return false;
  const glm::vec3 normal = across / area;
  const bool sheet = refined.vertices()[refined.leaf(slot)[0]].sheet;
  for (const glm::vec3& eye_m : eyes_rel_m_) {
    const glm::vec3 to_eye = eye_m - centre_m;
    const float sine = glm::dot(normal, to_eye) / std::max(glm::length(to_eye), 1e-6F);
    if (!sheet && sine < -kBackSine) continue;
    std::array<CasterRay, 4> rays;
    std::array<float, 4> distance_m{};
    for (std::size_t i = 0; i < rays.size(); ++i) {
      // Corners a little towards the middle, lest a neighbour across an edge hides them.
      const glm::vec3 point_m = i < 3 ? glm::mix(corners_m[i], centre_m, 0.1F) : centre_m;
      distance_m[i] = glm::distance(eye_m, point_m);
      rays[i] = {eye_m, (point_m - eye_m) / std::max(distance_m[i], 1e-6F)};
    }
    std::array<CasterHit, 4> hits;
    const std::uint32_t hit = in_.rays.first_hits(rays, {true, {}}, hits);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if ((hit >> i & 1U) == 0 || hits[i].distance_m > kSeenFrac * distance_m[i]) return true;
    }
  }
  return false;
}

bool SurfaceRefinement::too_coarse(const RefinedMesh& refined, std::uint32_t slot,
                                   const SurfacePatch& patch) const {
  const auto& leaf = refined.leaf(slot);
  const auto vertices = refined.vertices();
  std::array<glm::vec3, 3> corners_m;
  glm::vec3 centre_m(0.0F);
  for (std::size_t i = 0; i < 3; ++i) {
    // Not the samples' own places: those are moved off edges.
    corners_m[i] = glm::vec3(patch.rel_from_mesh * glm::vec4(vertices[leaf[i]].position_m, 1.0F));
    if (patch.mover >= 0) {
      const MoverPlacement& place = in_.movers_now[static_cast<std::size_t>(patch.mover)];
      corners_m[i] = place.rel_from_body * corners_m[i] + place.position_m;
    }
    centre_m += corners_m[i] / 3.0F;
  }
  const float longest_m = std::max({glm::distance(corners_m[0], corners_m[1]),
                                    glm::distance(corners_m[1], corners_m[2]),
                                    glm::distance(corners_m[2], corners_m[0])});
  const float pixel_m = this->pixel_m(centre_m);
  if (longest_m <= kLeastShadowEdgePx * pixel_m) return false;
  if (in_.materials[vertices[leaf[0]].material].prescribed_k) return false;
  if (longest_m > seed_edge_m(centre_m, longest_m)) return true;
  if (longest_m < kTestedPx * pixel_m && !seen(corners_m, refined, slot, patch)) {
    return false;
  }

  const bool smooth = longest_m > kLeastEdgePx * pixel_m;
  const std::size_t count = in_.record.size();
  const float bend_k = bend_.cost_k(refined, slot, patch);
  if (bend_k > (smooth ? kBendFrac : kSharpBendFrac) * tolerance_k_) return true;

  // Near edges and feet heat also moves along the surface, over the depth it reaches in that time.
  const float depth_m = std::sqrt(diffusivity_m2_s_[vertices[leaf[0]].material] * kCreaseS);
  const auto flat_m = [&](std::size_t i) { return patch.samples[leaf[i]].flat_m; };
  if (smooth && lateral_ && longest_m > depth_m &&
      std::min({flat_m(0), flat_m(1), flat_m(2)}) < kCreaseDepths * depth_m) {
    return true;
  }

  const auto offset_k = [&](std::size_t i) { return patch.outputs[leaf[i]].offset_k; };
  const float range_k = std::max({offset_k(0), offset_k(1), offset_k(2)}) -
                        std::min({offset_k(0), offset_k(1), offset_k(2)});
  const std::uint32_t newest = std::max({leaf[0], leaf[1], leaf[2]});
  if (patch.surplus_k[newest] > (smooth ? kSurplusFrac : kSharpSurplusFrac) * tolerance_k_)
    return true;
  if (range_k < tolerance_k_ || longest_m < kEdgeSunPx * pixel_m) return false;
  for (std::size_t i = recent_; i < count; ++i) {
    const auto sun = [&](std::size_t corner) {
      const glm::vec3 normal = in_.record.rays[i].normal(patch.samples[leaf[corner]]);
      return patch.sun_frac[leaf[corner] * count + i] *
             std::max(0.0F, glm::dot(normal, in_.record.rays[i].to_sun()));
    };
    const float high = std::max({sun(0), sun(1), sun(2)});
    const float low = std::min({sun(0), sun(1), sun(2)});
    if (high - low > kEdgeSunFrac) return true;
  }
  return false;
}

void SurfaceRefinement::flag(std::uint32_t mesh, const RefinedMesh& refined,
                             std::span<const SurfacePatch> patches,
                             std::vector<std::uint32_t>& slots) const {
  std::vector<std::uint8_t> flagged(refined.leaf_count(), 0);
  for (const SurfacePatch& patch : patches) {
    if (patch.mesh != mesh) continue;
    run_parallel(flagged.size(), 256, [&](std::size_t from, std::size_t to) {
      for (std::size_t slot = from; slot < to; ++slot) {
        if (flagged[slot] == 0 && too_coarse(refined, static_cast<std::uint32_t>(slot), patch)) {
          flagged[slot] = 1;
        }
      }
    });
  }
  slots.clear();
  for (std::uint32_t slot = 0; slot < flagged.size(); ++slot) {
    if (flagged[slot] != 0) slots.push_back(slot);
  }
}

}  // namespace emit::renderer
