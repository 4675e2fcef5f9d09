// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_bend.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace emit::renderer {
namespace {

/// Distance within which the surface as loaded is searched, as a share of the triangle's longest
/// edge.
constexpr float kReachFrac = 0.25F;

}  // namespace

float SurfaceBend::cost_at_k(const glm::vec3& weight, const RefinedMesh& refined,
                             std::uint32_t slot, const SurfacePatch& patch) const {
  const auto& leaf = refined.leaf(slot);
  const auto vertices = refined.vertices();
  const std::size_t count = in_.record.size();
  const std::uint32_t material = vertices[leaf[0]].material;
  const auto place = [&](std::size_t i) { return vertices[leaf[i]].position_m; };
  const float reach_m =
      kReachFrac * std::max({glm::distance(place(0), place(1)), glm::distance(place(1), place(2)),
                             glm::distance(place(2), place(0))});
  // Interpolate the corners: place, normal in axes of the mesh, and normal in rel axes as drawn.
  glm::vec3 position_m(0.0F);
  glm::vec3 normal(0.0F);
  glm::vec3 drawn_facing(0.0F);
  glm::vec3 to_sky(0.0F);
  for (glm::length_t k = 0; k < 3; ++k) {
    const std::uint32_t corner = leaf[static_cast<std::size_t>(k)];
    position_m += weight[k] * vertices[corner].position_m;
    normal += weight[k] * vertices[corner].normal;
    drawn_facing += weight[k] * patch.samples[corner].normal;
    to_sky += weight[k] * patch.to_sky[corner];
  }
  const float length = glm::length(normal);
  if (!(length > 0.0F)) return 0.0F;
  // Find the surface as loaded next to that place.
  const auto full = in_.detail->place(patch.mesh, position_m, normal / length, reach_m);
  if (!full) return 0.0F;
  const glm::vec3 facing = glm::normalize(patch.normal_from_mesh * full->normal);
  // Add up the differences that the other normal makes: of the sky, then of the sun in each
  // interval.
  float cost_k = sensitivity_.sky_k(material) * glm::dot(to_sky, facing - drawn_facing);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3& to_sun = in_.record.rays[i].to_sun();
    float sun_frac = 0.0F;
    float drawn_frac = 0.0F;
    for (glm::length_t k = 0; k < 3; ++k) {
      const std::uint32_t corner = leaf[static_cast<std::size_t>(k)];
      const float share = weight[k] * patch.sun_frac.row(corner)[i];
      sun_frac += share;
      drawn_frac += share * std::max(0.0F, glm::dot(patch.samples[corner].normal, to_sun));
    }
    cost_k += sensitivity_.sun_k(material, i) *
              (sun_frac * std::max(0.0F, glm::dot(facing, to_sun)) - drawn_frac);
  }
  return std::abs(cost_k);
}

float SurfaceBend::cost_k(const RefinedMesh& refined, std::uint32_t slot,
                          const SurfacePatch& patch) const {
  if (in_.detail == nullptr || !in_.detail->has(patch.mesh)) return 0.0F;
  constexpr float kThird = 1.0F / 3.0F;
  // Take places near the middles of the edges, not on them: a crease has two normals.
  constexpr float kNear = 0.46F;
  constexpr float kFar = 1.0F - 2.0F * kNear;
  float greatest_k = 0.0F;
  for (const glm::vec3& weight : {glm::vec3(kThird, kThird, kThird), glm::vec3(kNear, kNear, kFar),
                                  glm::vec3(kFar, kNear, kNear), glm::vec3(kNear, kFar, kNear)}) {
    greatest_k = std::max(greatest_k, cost_at_k(weight, refined, slot, patch));
  }
  return greatest_k;
}

}  // namespace emit::renderer
