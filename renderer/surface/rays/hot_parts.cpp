// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/hot_parts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <utility>

#include "emit/physics/constants.hpp"
#include "surface/rays/held_faces.hpp"

namespace emit::renderer {
namespace {

/// Blackbody that fills the view where a part does not.
constexpr double kOtherwiseK = 300.0;
/// Irradiance below which a part does not count.
constexpr float kLeastW_m2 = 0.1F;
/// Distance from which a part counts as small, in radii.
constexpr float kFarRadii = 8.0F;
constexpr std::size_t kShadowRays = 4;
/// Share of the way to a face in which something must stand to hide it.
constexpr float kBeforeFaceFrac = 0.995F;
/// Distance before a face in which nothing hides it, in radii of its part.
constexpr float kSlackRadii = 0.3F;
/// Least distance in the bound of what a part can send.
constexpr float kNearestM = 0.02F;
const float kPiF = static_cast<float>(physics::kPi);

/// Returns the share of places that nothing hides from a start. What stands within `slack_m` before
/// a place hides nothing: bodies that cast shade may be coarser than their faces.
float visible_frac(const CasterRays& rays, const CasterSelection& selection,
                   const glm::vec3& start_m, std::span<const glm::vec3> places_m,
                   float slack_m) noexcept {
  std::array<CasterRay, kShadowRays> sent;
  std::array<CasterHit, kShadowRays> hits;
  std::array<float, kShadowRays> way_m{};
  float farthest_m = 0.0F;
  for (std::size_t k = 0; k < places_m.size(); ++k) {
    const glm::vec3 way = places_m[k] - start_m;
    way_m[k] = glm::length(way);
    sent[k] = {start_m, way / way_m[k]};
    farthest_m = std::max(farthest_m, way_m[k]);
  }
  const std::uint32_t met =
      rays.first_hits(std::span(sent).first(places_m.size()), selection, hits, farthest_m);
  std::size_t visible = 0;
  for (std::size_t k = 0; k < places_m.size(); ++k) {
    const bool hidden =
        ((met >> k) & 1U) != 0U && hits[k].distance_m < kBeforeFaceFrac * way_m[k] - slack_m;
    if (!hidden) ++visible;
  }
  return static_cast<float>(visible) / static_cast<float>(places_m.size());
}

/// Returns the point of a triangle that is nearest to another point.
glm::vec3 nearest_of(const std::array<glm::vec3, 3>& corners_m, const glm::vec3& point_m) noexcept {
  const glm::vec3 across = glm::cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0]);
  glm::vec3 found_m = corners_m[0];
  float least_m = std::numeric_limits<float>::infinity();
  bool inside = glm::dot(across, across) > 0.0F;
  for (std::size_t c = 0; c < 3; ++c) {
    const glm::vec3& from_m = corners_m[c];
    const glm::vec3 edge_m = corners_m[(c + 1) % 3] - from_m;
    const glm::vec3 to_m = point_m - from_m;
    inside = inside && glm::dot(glm::cross(edge_m, to_m), across) >= 0.0F;
    const float squared = glm::dot(edge_m, edge_m);
    const float share =
        squared > 0.0F ? glm::clamp(glm::dot(to_m, edge_m) / squared, 0.0F, 1.0F) : 0.0F;
    const glm::vec3 place_m = from_m + share * edge_m;
    const float away_m = glm::distance(place_m, point_m);
    if (away_m < least_m) {
      least_m = away_m;
      found_m = place_m;
    }
  }
  if (!inside) return found_m;
  // The foot of the point lies within the triangle.
  const glm::vec3 unit = glm::normalize(across);
  return point_m - glm::dot(point_m - corners_m[0], unit) * unit;
}

}  // namespace

HotParts::HotParts(const scene::SceneGeometry& geometry,
                   std::span<const std::int32_t> entity_of_object) {
  std::map<std::pair<std::int32_t, std::uint32_t>, std::size_t> index;
  for (const scene::Instance& instance : geometry.instances) {
    const std::int32_t entity = entity_of_object[instance.object];
    if (entity < 0) continue;
    const scene::Mesh& mesh = geometry.meshes[instance.mesh];
    const bool mirrored = glm::determinant(glm::dmat3(instance.body_from_mesh)) < 0.0;
    for (const scene::Submesh& submesh : mesh.submeshes) {
      const scene::Material& material = geometry.materials[submesh.material];
      if (!hot(material)) continue;
      const auto [found, added] = index.try_emplace({entity, submesh.material}, parts_.size());
      if (added) {
        Part& part = parts_.emplace_back();
        part.entity = static_cast<std::size_t>(entity);
        part.sent_w_m2 = static_cast<float>(
            material.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 *
            (std::pow(*material.prescribed_k, 4.0) - std::pow(kOtherwiseK, 4.0)));
      }
      Part& part = parts_[found->second];
      for (std::uint32_t k = 0; k + 2 < submesh.index_count; k += 3) {
        Face face{.corners_m = {}, .area_m2 = {}, .two_sided = material.sheet};
        for (std::size_t c = 0; c < 3; ++c) {
          const std::uint32_t vertex = mesh.indices[submesh.first_index + k + c];
          face.corners_m[c] = glm::vec3(instance.body_from_mesh *
                                        glm::dvec4(glm::dvec3(mesh.positions_m[vertex]), 1.0));
        }
        if (mirrored) std::swap(face.corners_m[1], face.corners_m[2]);
        face.area_m2 = 0.5F * glm::cross(face.corners_m[1] - face.corners_m[0],
                                         face.corners_m[2] - face.corners_m[0]);
        part.faces.push_back(face);
      }
    }
  }
  // Enclose each part in a ball.
  std::erase_if(parts_, [](const Part& part) { return part.faces.empty(); });
  for (Part& part : parts_) {
    scene::Aabb box;
    for (const Face& face : part.faces) {
      part.area_m2 += glm::length(face.area_m2) * (face.two_sided ? 2.0F : 1.0F);
      for (const glm::vec3& corner : face.corners_m) box.add(glm::dvec3(corner));
    }
    part.centre_m = glm::vec3(0.5 * (box.min_m + box.max_m));
    part.radius_m = static_cast<float>(0.5 * glm::length(box.max_m - box.min_m));
  }
}

float HotParts::on_w_m2(const CasterRays& rays, const IntervalRays& interval,
                        const glm::vec3& start_m, const glm::vec3& normal) const noexcept {
  float sum_w_m2 = 0.0F;
  for (const Part& part : parts_) {
    if (!interval.stands(part.entity)) continue;
    const CasterSelection selection{true, interval.middle_placements()};
    const EntityPlacement& place = selection.entities[part.entity];
    const glm::vec3 way = place.rel_from_body * part.centre_m + place.position_m - start_m;
    const float ahead_m = glm::dot(way, normal);
    if (ahead_m + part.radius_m <= 0.0F) continue;
    // Leave out what cannot count even if all of its area looked here.
    const float away_m = glm::length(way);
    const float near_m = std::max(away_m - part.radius_m, kNearestM);
    const float cosine = std::min(1.0F, (ahead_m + part.radius_m) / near_m);
    if (std::abs(part.sent_w_m2) * part.area_m2 * cosine < kLeastW_m2 * kPiF * near_m * near_m) {
      continue;
    }
    sum_w_m2 += away_m > kFarRadii * part.radius_m
                    ? far_w_m2(part, place, rays, selection, start_m, normal)
                    : near_w_m2(part, place, rays, selection, start_m, normal);
  }
  return sum_w_m2;
}

float HotParts::missed_w_m2(const IntervalRays& interval, const std::array<glm::vec3, 3>& corners_m,
                            const glm::vec3& normal, float wide_frac) const noexcept {
  const float longest_m = std::max({glm::distance(corners_m[0], corners_m[1]),
                                    glm::distance(corners_m[1], corners_m[2]),
                                    glm::distance(corners_m[2], corners_m[0])});
  float most_w_m2 = 0.0F;
  for (const Part& part : parts_) {
    if (!interval.stands(part.entity)) continue;
    const EntityPlacement& place = interval.middle_placements()[part.entity];
    const glm::vec3 centre_m = place.rel_from_body * part.centre_m + place.position_m;
    const glm::vec3 way = centre_m - nearest_of(corners_m, centre_m);
    const float ahead_m = glm::dot(way, normal);
    if (ahead_m + part.radius_m <= 0.0F) continue;
    const float away_m = std::max(glm::length(way), part.radius_m);
    if (longest_m <= wide_frac * away_m) continue;
    // A body that sends to all sides shows a quarter of its area in the mean.
    const float cosine = std::min(1.0F, (ahead_m + part.radius_m) / away_m);
    const float frac = std::min(1.0F, 0.25F * part.area_m2 * cosine / (kPiF * away_m * away_m));
    most_w_m2 = std::max(most_w_m2, std::abs(part.sent_w_m2) * frac);
  }
  return most_w_m2;
}

float HotParts::far_w_m2(const Part& part, const EntityPlacement& place, const CasterRays& rays,
                         const CasterSelection& selection, const glm::vec3& start_m,
                         const glm::vec3& normal) const noexcept {
  const glm::vec3 way = place.rel_from_body * part.centre_m + place.position_m - start_m;
  const float away_m = glm::length(way);
  const glm::vec3 direction = way / away_m;
  const glm::vec3 in_body = glm::transpose(place.rel_from_body) * direction;
  const auto projected_m2 = [&in_body](const Face& face) {
    const float towards_m2 = -glm::dot(face.area_m2, in_body);
    return face.two_sided ? std::abs(towards_m2) : std::max(0.0F, towards_m2);
  };
  float area_m2 = 0.0F;
  for (const Face& face : part.faces) area_m2 += projected_m2(face);
  const float cosine = std::max(0.0F, glm::dot(direction, normal));
  const float open_w_m2 = part.sent_w_m2 * area_m2 * cosine / (kPiF * away_m * away_m);
  if (std::abs(open_w_m2) < kLeastW_m2) return 0.0F;
  // Send the rays to the middles of faces that stand for equal shares of the projected area.
  std::array<glm::vec3, kShadowRays> places_m;
  std::size_t count = 0;
  float passed_m2 = 0.0F;
  for (const Face& face : part.faces) {
    passed_m2 += projected_m2(face);
    while (count < kShadowRays &&
           passed_m2 > (static_cast<float>(count) + 0.5F) / kShadowRays * area_m2) {
      places_m[count++] = place.rel_from_body *
                              ((face.corners_m[0] + face.corners_m[1] + face.corners_m[2]) / 3.0F) +
                          place.position_m;
    }
  }
  if (count == 0) return 0.0F;
  return open_w_m2 * visible_frac(rays, selection, start_m, std::span(places_m).first(count),
                                  kSlackRadii * part.radius_m);
}

float HotParts::near_w_m2(const Part& part, const EntityPlacement& place, const CasterRays& rays,
                          const CasterSelection& selection, const glm::vec3& start_m,
                          const glm::vec3& normal) const noexcept {
  float sum_w_m2 = 0.0F;
  for (const Face& face : part.faces) {
    std::array<glm::vec3, 3> at_m = face.corners_m;
    std::array<glm::dvec3, 3> from_start_m;
    for (std::size_t c = 0; c < 3; ++c) {
      at_m[c] = place.rel_from_body * at_m[c] + place.position_m;
      from_start_m[c] = glm::dvec3(at_m[c] - start_m);
    }
    const glm::vec3 outward = place.rel_from_body * face.area_m2;
    if (glm::dot(outward, start_m - at_m[0]) < 0.0F && !face.two_sided) continue;
    const double frac = std::abs(form_factor(from_start_m, glm::dvec3(normal)));
    if (!(frac > 0.0)) continue;
    // Take the middle of the face and of the three parts at its corners.
    const glm::vec3 middle_m = (at_m[0] + at_m[1] + at_m[2]) / 3.0F;
    const std::array<glm::vec3, kShadowRays> places_m{middle_m, 0.5F * (middle_m + at_m[0]),
                                                      0.5F * (middle_m + at_m[1]),
                                                      0.5F * (middle_m + at_m[2])};
    sum_w_m2 += part.sent_w_m2 * static_cast<float>(frac) *
                visible_frac(rays, selection, start_m, places_m, kSlackRadii * part.radius_m);
  }
  return sum_w_m2;
}

bool HotParts::same(const IntervalRays& before, const IntervalRays& now) const noexcept {
  return std::ranges::all_of(parts_, [&](const Part& part) {
    const EntityPlacement& a = before.middle_placements()[part.entity];
    const EntityPlacement& b = now.middle_placements()[part.entity];
    return before.stands(part.entity) == now.stands(part.entity) && a.on == b.on &&
           a.position_m == b.position_m && a.rel_from_body == b.rel_from_body;
  });
}

}  // namespace emit::renderer
