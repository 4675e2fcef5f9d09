// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_refinement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "emit/threads/parallel.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Greatest width of any triangle in pixels, even if nothing is known to lie in it: in the field of
/// view, and elsewhere.
constexpr float kBasePx = 32.0F;
constexpr float kBaseAsidePx = 128.0F;
constexpr float kBaseNeed = 1e6F;  ///< need of triangles wider than that
/// Need below which a triangle is left as it is: an error of one tolerance in a triangle of that
/// many pixels.
constexpr float kMinNeed = 3.0F;
/// Share of its need that counts if a triangle is out of view.
constexpr float kAsideFrac = 1.0F / 64.0F;
/// Allowed error from shade that points between the corners meet, in tolerances.
constexpr float kMissedFrac = 2.0F;
/// Age in s up to which edges of shadows are still sharp.
constexpr float kRecentS = 900.0F;
/// Difference of the sun's flux between corners, as a share of full sun, from which the edge of a
/// shadow lies between them.
constexpr float kEdgeSunFrac = 0.2F;
/// Width in pixels down to which such an edge alone is reason to halve. Finer triangles are halved
/// only for errors of interpolation.
constexpr float kEdgeSunPx = 4.0F;
/// Corners agree on the sun if their visible shares of the disc are within this of 0 or of 1.
constexpr float kAgreeFrac = 1e-3F;
/// Sine by which a triangle must turn its back to an eye to be unseen from there. It allows for the
/// curvature that the normals of the vertices stand for.
constexpr float kBackSine = 0.2F;
/// Width in pixels down to which triangles are halved along edges of shadows that come, and the
/// error that such an edge counts for, in tolerances.
constexpr float kComingEdgePx = 2.0F;
constexpr float kComingFrac = 10.0F;
/// Share of the way to a point that must be free if the point is to be seen.
constexpr float kSeenFrac = 0.999F;
/// Allowed difference of the newest vertex from the mean of its parents, in tolerances, for large
/// and for small triangles. The triangle's own error is about half of it.
constexpr float kSurplusFrac = 1.2F;
constexpr float kSharpSurplusFrac = 8.0F;
/// Error of a triangle that a foot runs through, in tolerances.
constexpr float kFootFrac = 30.0F;
/// Samples at an edge lie as close as heat spreads in that time, s, or as this share of the length
/// over which a thin layer conducts against losses of that many W m-2 K-1. Farther off they lie
/// this share of the distance from the edge apart.
constexpr double kCreaseS = 100.0;
constexpr double kSkinFrac = 1.0 / 3.0;
constexpr double kSkinLossesW_m2_k = 19.0;
constexpr float kCreaseFrac = 0.7F;
/// Distance from an edge up to which that holds, in thicknesses of the stack, and error of a
/// coarser triangle, in tolerances.
constexpr double kCreaseThicknesses = 1.0;
constexpr float kCreaseTolerances = 3.0F;
/// Shortest edges that are halved for it, in pixels.
constexpr float kMinCreasePx = 2.0F;
/// Triangles wider than this share of the way to a hot part may miss what it sends, and losses by
/// which that becomes a temperature: those of a face in calm air.
constexpr float kWideFrac = 0.5F;
constexpr float kHotLossesW_m2_k = 12.0F;
/// Allowed error from facing elsewhere, in tolerances, for large triangles and for those of a few
/// pixels.
constexpr float kBendFrac = 1.0F;
constexpr float kSharpBendFrac = 4.0F;
/// Shortest edges that are halved, in pixels: where the temperature is smooth, and where the edge
/// of a shadow runs. Finer ones change no pixel by more than a tenth of a kelvin (emit bench
/// error-vs-time).
constexpr float kMinEdgePx = 2.5F;
constexpr float kMinShadowEdgePx = 0.9F;
/// Width in pixels that narrower bodies are taken for, because their pixels show a mean over all
/// their faces; and the greatest factor, because a body far below a pixel hardly counts.
constexpr float kMinBodyPx = 16.0F;
constexpr float kMaxFiner = 12.0F;

/// Width of a body: the middle one of its three extents, in m. This is the thickness of a pole, but
/// not that of a sheet.
float width_m(const scene::Aabb& box, const glm::dmat4& world_from_mesh) {
  if (box.empty()) return 0.0F;
  std::array<double, 3> extent_m{};
  for (int i = 0; i < 3; ++i) {
    extent_m[static_cast<std::size_t>(i)] =
        (box.max_m[i] - box.min_m[i]) * glm::length(glm::dvec3(world_from_mesh[i]));
  }
  std::ranges::sort(extent_m);
  return static_cast<float>(extent_m[1]);
}

/// Place of an eye relative to an entity when the entity comes closest to the middle of the image,
/// as a place beside the entity where its way begins.
glm::vec3 when_in_view(const glm::vec3& eye_m, const glm::vec3& boresight,
                       std::span<const glm::vec3> way_m) {
  constexpr int kParts = 8;  // places per leg of the way
  glm::vec3 found_m = way_m.front();
  float most = -std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < way_m.size(); ++i) {
    const glm::vec3& end_m = way_m[std::min(i + 1, way_m.size() - 1)];
    for (int part = 0; part < kParts; ++part) {
      const glm::vec3 place_m =
          glm::mix(way_m[i], end_m, static_cast<float>(part) / static_cast<float>(kParts));
      const glm::vec3 there_m = place_m - eye_m;
      const float cosine = glm::dot(there_m, boresight) / std::max(glm::length(there_m), 1e-3F);
      if (!(cosine > most)) continue;
      most = cosine;
      found_m = place_m;
    }
  }
  return eye_m - (found_m - way_m.front());
}

/// Points of a leaf, spread evenly (R2 sequence, Roberts 2018), at other places in every leaf. They
/// lie in the frame of the patch.
std::array<glm::vec3, kPacketRays> spread_points_m(const std::array<std::uint32_t, 3>& leaf,
                                                   const SurfacePatch& patch) {
  constexpr float kStepU = 0.7548776662F;
  constexpr float kStepV = 0.5698402910F;
  std::array<glm::vec3, kPacketRays> points_m;
  for (std::size_t k = 0; k < points_m.size(); ++k) {
    const auto turn = static_cast<float>((leaf[0] * 7U + leaf[1] * 5U + leaf[2] * 3U) % 1021U +
                                         static_cast<std::uint32_t>(k) + 1U);
    float u = turn * kStepU - std::floor(turn * kStepU);
    float v = turn * kStepV - std::floor(turn * kStepV);
    if (u + v > 1.0F) {
      u = 1.0F - u;
      v = 1.0F - v;
    }
    points_m[k] = (1.0F - u - v) * patch.samples[leaf[0]].position_m +
                  u * patch.samples[leaf[1]].position_m + v * patch.samples[leaf[2]].position_m;
  }
  return points_m;
}

/// Face of a leaf with the mean normal of its corners; false if they cancel.
bool mean_face(const std::array<std::uint32_t, 3>& leaf, const SurfacePatch& patch,
               SurfaceSample& face) {
  const glm::vec3 normal =
      patch.samples[leaf[0]].normal + patch.samples[leaf[1]].normal + patch.samples[leaf[2]].normal;
  const float length = glm::length(normal);
  if (!(length > 0.0F)) return false;
  face.normal = normal / length;
  face.entity = patch.entity;
  face.material = patch.samples[leaf[0]].material;
  return true;
}

}  // namespace

SurfaceRefinement::SurfaceRefinement(const SurfaceInputs& inputs,
                                     const DriveSensitivity& sensitivity, const RefineView& view,
                                     const SurfaceModelOptions& options)
    : in_(inputs),
      sensitivity_(sensitivity),
      bend_(inputs, sensitivity_),
      pixel_rad_(static_cast<float>(view.pixel_rad)),
      field_rad_(static_cast<float>(view.field_rad)),
      tolerance_k_(static_cast<float>(options.tolerance_k)),
      lateral_(options.lateral),
      judged_(inputs.geometry.meshes.size()) {
  for (const scene::Material& material : inputs.materials) {
    CreaseSize size;
    if (const double a = diffusivity_m2_s(material); a > 0.0) {
      const scene::Layer& outer = material.layers.front();
      size.least_m = static_cast<float>(std::min(
          std::sqrt(a * kCreaseS),
          kSkinFrac * std::sqrt(outer.conductivity_w_m_k * outer.thickness_m / kSkinLossesW_m2_k)));
      for (const scene::Layer& layer : material.layers) {
        size.reach_m += static_cast<float>(kCreaseThicknesses * layer.thickness_m);
      }
    }
    crease_sizes_.push_back(size);
  }
  // Bring the eyes into rel axes, and for each entity to where its script brings it into view.
  for (const RefineView::Eye& eye : view.eyes) {
    eyes_.push_back(
        {glm::vec3(eye.world_m - inputs.rays.origin_world_m()), glm::vec3(eye.boresight)});
  }
  // An entity that no script moves from here on may be brought anywhere by the host: take it for in
  // view, at the distance that it has now.
  for (const std::vector<glm::vec3>& way_m : inputs.ways_m) {
    const bool planned = way_m.size() > 1;
    std::vector<Eye>& eyes = eyes_of_entity_.emplace_back();
    for (const Eye& eye : eyes_) {
      eyes.push_back({when_in_view(eye.rel_m, eye.boresight, way_m),
                      planned ? eye.boresight : glm::vec3(0.0F)});
    }
  }
  for (const scene::Instance& instance : inputs.geometry.instances) {
    body_m_.push_back(
        width_m(inputs.geometry.meshes[instance.mesh].bounds, instance.world_from_mesh));
  }
  for (const glm::dvec3& to_sun : view.coming_suns) {
    coming_.emplace_back(std::vector<float>());
    coming_.back().hold(to_sun);
  }
  const HistoryRecord& record = inputs.record;
  if (options.exchange) hot_ = HotParts(inputs.geometry, inputs.entity_of_object);
  for (std::size_t i = 0; i < record.size() && !hot_.empty(); ++i) {
    if (i == 0 || !hot_.same(record.rays[i - 1], record.rays[i])) hot_since_.push_back(i);
  }
  // Find the first interval in which edges of shadows are still sharp.
  recent_ = record.size() - 1;
  while (recent_ > 0 && record.lag_s[recent_ - 1] < kRecentS) --recent_;
}

SurfaceRefinement::Width SurfaceRefinement::width(const std::array<glm::vec3, 3>& corners_m,
                                                  const glm::vec3& origin_m, float longest_m,
                                                  float body_m,
                                                  std::span<const Eye> eyes) const noexcept {
  constexpr float kMinM = 1e-6F;
  const glm::vec3 centre_m = (corners_m[0] + corners_m[1] + corners_m[2]) / 3.0F;
  const glm::vec3 twice_area_m2 =
      glm::cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0]);
  Width width;
  float least_px_m = std::numeric_limits<float>::infinity();
  for (const Eye& eye : eyes) {
    const glm::vec3 way_m = centre_m + (origin_m - eye.rel_m);
    const float distance_m = std::max(glm::length(way_m), kMinM);
    const float px_m = std::max(pixel_rad_ * distance_m, kMinM);
    least_px_m = std::min(least_px_m, px_m);
    // Measure the square that is as large as the triangle looks, up to the longest edge.
    const glm::vec3 ahead = way_m / distance_m;
    const float looks_px =
        std::min(std::sqrt(std::abs(glm::dot(twice_area_m2, ahead))) / px_m, longest_m / px_m);
    width.edge_px = std::max(width.edge_px, longest_m / px_m);
    width.anywhere_px = std::max(width.anywhere_px, looks_px);
    if (looks_px <= width.in_view_px) continue;
    // Count it as in view if it reaches into the field around the boresight.
    const float cosine = std::clamp(glm::dot(ahead, eye.boresight), -1.0F, 1.0F);
    const bool in_view = eye.boresight == glm::vec3(0.0F) || distance_m < longest_m ||
                         std::acos(cosine) < field_rad_ + longest_m / distance_m;
    if (in_view) width.in_view_px = looks_px;
  }
  width.finer = std::clamp(kMinBodyPx * least_px_m / std::max(body_m, kMinM), 1.0F, kMaxFiner);
  return width;
}

bool SurfaceRefinement::seen(const std::array<glm::vec3, 3>& corners_m, const RefinedMesh& refined,
                             std::uint32_t slot, const SurfacePatch& patch) const {
  if (patch.entity >= 0) return true;
  const glm::vec3 centre_m = (corners_m[0] + corners_m[1] + corners_m[2]) / 3.0F;
  const glm::vec3 across = glm::cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0]);
  const float area = glm::length(across);
  if (!(area > 0.0F)) return false;
  const glm::vec3 normal = across / area;
  const bool sheet = refined.vertices()[refined.leaf(slot)[0]].sheet;
  for (const Eye& eye : eyes_) {
    const glm::vec3& eye_m = eye.rel_m;
    const glm::vec3 to_eye = eye_m - centre_m;
    const float sine = glm::dot(normal, to_eye) / std::max(glm::length(to_eye), 1e-6F);
    if (!sheet && sine < -kBackSine) continue;
    std::array<CasterRay, 4> rays;
    std::array<float, 4> distance_m{};
    for (std::size_t i = 0; i < rays.size(); ++i) {
      // Move the corners a little inwards, so that no neighbour across an edge hides them.
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

float SurfaceRefinement::shadow_edge_k(const RefinedMesh& refined, std::uint32_t slot,
                                       const SurfacePatch& patch) const {
  const auto& leaf = refined.leaf(slot);
  const std::size_t count = in_.record.size();
  const auto offset_k = [&](std::size_t i) { return patch.outputs[leaf[i]].offset_k; };
  const float range_k = std::max({offset_k(0), offset_k(1), offset_k(2)}) -
                        std::min({offset_k(0), offset_k(1), offset_k(2)});
  if (range_k < tolerance_k_) return 0.0F;
  // Look for a recent interval in which the sun's flux differs between the corners.
  for (std::size_t i = recent_; i < count; ++i) {
    const auto sun = [&](std::size_t corner) {
      const glm::vec3 normal = in_.record.rays[i].normal(patch.samples[leaf[corner]]);
      return patch.sun_frac.row(leaf[corner])[i] *
             std::max(0.0F, glm::dot(normal, in_.record.rays[i].to_sun()));
    };
    const float high = std::max({sun(0), sun(1), sun(2)});
    const float low = std::min({sun(0), sun(1), sun(2)});
    if (high - low > kEdgeSunFrac) return range_k;
  }
  return 0.0F;
}

float SurfaceRefinement::missed_heat_k(const std::array<glm::vec3, 3>& corners_m,
                                       const glm::vec3& normal) const {
  float most_w_m2 = 0.0F;
  for (const std::size_t i : hot_since_) {
    most_w_m2 =
        std::max(most_w_m2, hot_.missed_w_m2(in_.record.rays[i], corners_m, normal, kWideFrac));
  }
  return most_w_m2 / kHotLossesW_m2_k;
}

float SurfaceRefinement::missed_shade_k(const RefinedMesh& refined, std::uint32_t slot,
                                        const SurfacePatch& patch) const {
  const auto& leaf = refined.leaf(slot);
  const std::size_t count = in_.record.size();
  const SurfaceSample& a = patch.samples[leaf[0]];
  const SurfaceSample& b = patch.samples[leaf[1]];
  const SurfaceSample& c = patch.samples[leaf[2]];
  SurfaceSample face;
  if (!mean_face(leaf, patch, face)) return 0.0F;
  const std::array<glm::vec3, kPacketRays> points_m = spread_points_m(leaf, patch);
  const float facet_m = std::max({a.facet_m, b.facet_m, c.facet_m});
  const float sun_offset_m = ray_offsets(a.position_m, facet_m).sun_m;
  std::array<float, kPacketRays> missed_k{};
  for (std::size_t i = 0; i < count; ++i) {
    const IntervalRays& rays = in_.record.rays[i];
    if (!rays.sun_up()) continue;
    const auto frac = [&](std::size_t corner) { return patch.sun_frac.row(leaf[corner])[i]; };
    const float low = std::min({frac(0), frac(1), frac(2)});
    const float high = std::max({frac(0), frac(1), frac(2)});
    // Skip the interval if the corners disagree: they know of the edge already.
    const bool lit = low > 1.0F - kAgreeFrac;
    if (!lit && high > kAgreeFrac) continue;
    // Add the sensitivity to this interval at each point that finds the opposite.
    const float effect_k = sensitivity_.sun_k(face.material, i) *
                           std::max(0.0F, glm::dot(rays.normal(face), rays.to_sun()));
    const IntervalRays::Spots spots = rays.spots(in_.rays, face, points_m, sun_offset_m);
    const std::uint32_t odd = spots.faced & (lit ? ~spots.lit : spots.lit);
    for (std::size_t k = 0; k < points_m.size(); ++k) {
      if (((odd >> k) & 1U) != 0U) missed_k[k] += lit ? -effect_k : effect_k;
    }
  }
  float most_k = 0.0F;
  for (const float k : missed_k) most_k = std::max(most_k, std::abs(k));
  return most_k;
}

bool SurfaceRefinement::shadow_edge_comes(const RefinedMesh& refined, std::uint32_t slot,
                                          const SurfacePatch& patch) const {
  const auto& leaf = refined.leaf(slot);
  SurfaceSample face;
  if (patch.entity >= 0 || !mean_face(leaf, patch, face)) return false;
  // Take the corners too: an edge that cuts one off may miss all points between them.
  std::array<glm::vec3, kPacketRays> points_m = spread_points_m(leaf, patch);
  float facet_m = 0.0F;
  for (std::size_t i = 0; i < 3; ++i) {
    points_m[i] = patch.samples[leaf[i]].position_m;
    facet_m = std::max(facet_m, patch.samples[leaf[i]].facet_m);
  }
  const float sun_offset_m = ray_offsets(points_m[0], facet_m).sun_m;
  return std::ranges::any_of(coming_, [&](const IntervalRays& rays) {
    const IntervalRays::Spots spots = rays.spots(in_.rays, face, points_m, sun_offset_m);
    return spots.lit != 0U && spots.lit != spots.faced;
  });
}

SurfaceRefinement::Judged SurfaceRefinement::need(const RefinedMesh& refined, std::uint32_t slot,
                                                  const SurfacePatch& patch, float body_m) const {
  const auto& leaf = refined.leaf(slot);
  const auto vertices = refined.vertices();
  // Hold the corners of an entity relative to the origin of its body: far off, float32 would not
  // resolve their edges.
  std::array<glm::vec3, 3> corners_m;
  glm::vec3 origin_m(0.0F);
  for (std::size_t i = 0; i < 3; ++i) {
    // Take the vertices, because the samples' own places are moved off edges.
    corners_m[i] = glm::vec3(patch.rel_from_mesh * glm::vec4(vertices[leaf[i]].position_m, 1.0F));
    if (patch.entity >= 0) {
      const EntityPlacement& place = in_.entities_now[static_cast<std::size_t>(patch.entity)];
      corners_m[i] = place.rel_from_body * corners_m[i];
      origin_m = place.position_m;
    }
  }
  const float longest_m = std::max({glm::distance(corners_m[0], corners_m[1]),
                                    glm::distance(corners_m[1], corners_m[2]),
                                    glm::distance(corners_m[2], corners_m[0])});
  const auto entity = static_cast<std::size_t>(patch.entity);
  const bool goes = patch.entity >= 0 && entity < eyes_of_entity_.size();
  const Width width =
      this->width(corners_m, origin_m, longest_m, body_m, goes ? eyes_of_entity_[entity] : eyes_);
  const float edge_px = width.finer * width.edge_px;
  Judged judged{refined.node(slot), 0.0F, width.in_view_px > 0.0F};
  // Leave alone what is narrow enough, and what has a prescribed temperature.
  if (edge_px <= kMinShadowEdgePx) return judged;
  if (in_.materials[vertices[leaf[0]].material].prescribed_k) return judged;
  // Halve a triangle that is too wide, whatever lies in it.
  const float over_base = std::max(width.in_view_px / kBasePx, width.anywhere_px / kBaseAsidePx);
  if (over_base > 1.0F) {
    judged.need = kBaseNeed * over_base;
    judged.finer_need = judged.need;
    return judged;
  }
  if (!seen(corners_m, refined, slot, patch)) return judged;

  // Take the greatest of the errors that exceed their limits.
  const bool smooth = edge_px > kMinEdgePx;
  float error_k = 0.0F;
  const auto count_in = [&](float found_k, float limit_frac) {
    if (found_k > limit_frac * tolerance_k_) error_k = std::max(error_k, found_k);
  };
  const std::uint32_t newest = std::max({leaf[0], leaf[1], leaf[2]});
  count_in(patch.surplus_k[newest], smooth ? kSurplusFrac : kSharpSurplusFrac);
  count_in(bend_.cost_k(refined, slot, patch), smooth ? kBendFrac : kSharpBendFrac);
  // Halve a triangle that a foot runs through: its covered corners will take values of others.
  const auto covered = [&](std::size_t i) { return patch.samples[leaf[i]].covered ? 1 : 0; };
  const int under = covered(0) + covered(1) + covered(2);
  if (smooth && under > 0 && under < 3) error_k = std::max(error_k, kFootFrac * tolerance_k_);
  // Halve near edges and feet, because heat also moves along the surface there.
  const CreaseSize& crease = crease_sizes_[vertices[leaf[0]].material];
  const auto flat_m = [&](std::size_t i) { return patch.samples[leaf[i]].flat_m; };
  const float away_m = std::min({flat_m(0), flat_m(1), flat_m(2)});
  if (edge_px > kMinCreasePx && lateral_ && away_m < crease.reach_m &&
      longest_m > std::max(crease.least_m, kCreaseFrac * away_m)) {
    error_k = std::max(error_k, kCreaseTolerances * tolerance_k_);
  }
  // Halve what is wide beside its distance from a hot part.
  if (smooth && patch.entity < 0 && !hot_.empty()) {
    count_in(missed_heat_k(corners_m, patch.samples[newest].normal), 1.0F);
  }
  // Look for edges of shadows, on both faces of a sheet. Rays come last because they are expensive.
  if (edge_px >= kEdgeSunPx) {
    const bool sheet = in_.materials[vertices[leaf[0]].material].sheet;
    const SurfacePatch* back = sheet ? patch.back.get() : nullptr;
    error_k = std::max(error_k, shadow_edge_k(refined, slot, patch));
    if (back != nullptr) error_k = std::max(error_k, shadow_edge_k(refined, slot, *back));
    if (error_k == 0.0F) count_in(missed_shade_k(refined, slot, patch), kMissedFrac);
    if (back != nullptr && error_k == 0.0F) {
      count_in(missed_shade_k(refined, slot, *back), kMissedFrac);
    }
  }
  const float coming_k = kComingFrac * tolerance_k_;
  if (!coming_.empty() && edge_px >= kComingEdgePx && error_k < coming_k &&
      shadow_edge_comes(refined, slot, patch)) {
    error_k = coming_k;
  }
  const float weighed_px = std::max(width.in_view_px, kAsideFrac * width.anywhere_px);
  judged.need = error_k / tolerance_k_ * weighed_px;
  judged.finer_need = width.finer * judged.need;
  return judged;
}

SurfaceRefinement::Most SurfaceRefinement::judge(std::uint32_t mesh, const RefinedMesh& refined,
                                                 std::span<const SurfacePatch> patches,
                                                 std::span<const std::uint32_t> of_mesh) {
  std::vector<Judged>& judged = judged_[mesh];
  judged.resize(refined.leaf_count());
  constexpr std::size_t kGrain = 256;
  threads::parallel_parts(judged.size(), kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const auto slot = static_cast<std::uint32_t>(i);
      if (judged[i].node == refined.node(slot)) continue;
      judged[i] = {refined.node(slot)};
      float squares = 0.0F;
      float finer_squares = 0.0F;
      float uses = 0.0F;
      for (const std::uint32_t p : of_mesh) {
        const Judged here = need(refined, slot, patches[p], body_m_[p]);
        squares += here.need * here.need;
        finer_squares += here.finer_need * here.finer_need;
        uses += 1.0F;
        judged[i].in_view = judged[i].in_view || here.in_view;
      }
      // Take the root mean square over the instances: a new vertex costs a sample on each of them.
      const auto mean = [uses](float sum) { return std::sqrt(sum / std::max(uses, 1.0F)); };
      if (mean(finer_squares) > kMinNeed) judged[i].need = mean(squares);
    }
  });
  Most most;
  for (const Judged& leaf : judged) {
    if (leaf.need > 0.0F) most.coarse_leaves += of_mesh.size();
    most.need = std::max(most.need, leaf.need);
    if (leaf.in_view) most.in_view = std::max(most.in_view, leaf.need);
  }
  return most;
}

void SurfaceRefinement::list(std::uint32_t mesh, float above, std::vector<Need>& needs) const {
  needs.clear();
  const std::vector<Judged>& judged = judged_[mesh];
  for (std::uint32_t slot = 0; slot < judged.size(); ++slot) {
    if (judged[slot].need > above) needs.push_back({slot, judged[slot].need});
  }
}

void SurfaceRefinement::leave(std::uint32_t mesh, const RefinedMesh& refined,
                              std::span<const std::uint32_t> slots) {
  for (const std::uint32_t slot : slots) {
    Judged& leaf = judged_[mesh][slot];
    if (leaf.node == refined.node(slot)) leaf.need = 0.0F;
  }
}

}  // namespace emit::renderer
