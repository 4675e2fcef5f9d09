// SPDX-License-Identifier: Apache-2.0
// Walls on the ground at their feet.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/physics/constants.hpp"
#include "surface/columns/instance_columns.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer::columns {
namespace {

/// Distance from a foot, in depths of the middle of the first cell, beyond which it does not change
/// the difference between the surface and that cell.
constexpr double kExcessDepths = 20.0;

}  // namespace

double InstanceColumns::excess_frac(std::size_t column) const {
  const SurfaceSample& sample = samples_[vertices_[column]];
  if (sample.covered) return 0.0;
  const double depth_m = cells(vertices_[column]).middle_m(0);
  if (!(static_cast<double>(sample.foot_m) < kExcessDepths * depth_m)) return 1.0;
  return 0.5 + std::atan(static_cast<double>(sample.foot_m) / depth_m) / physics::kPi;
}

double InstanceColumns::depth_m(std::uint32_t vertex, std::span<const InstanceColumns> all) const {
  const SurfaceSample& own = samples_[vertex];
  const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
  const CasterRay ray{own.position_m - 2.0F * offset_m * own.normal, -own.normal};
  std::array<CasterHit, 1> hit;
  constexpr double kDeepM = 1e9;
  if (in_.places.first_hits({&ray, 1}, {true, {}}, hit) == 0U) return kDeepM;
  const InstanceColumns& body = all[hit[0].instance];
  const auto there = body.mesh_.locate(hit[0].triangle, hit[0].barycentric);
  return body.closed_in(body.samples_[there.vertex[0]])
             ? kDeepM
             : 0.5 * static_cast<double>(hit[0].distance_m + 2.0F * offset_m);
}

void InstanceColumns::each_foot(std::span<const InstanceColumns> all,
                                const FootVisit& visit) const {
  for (const Foot& foot : feet_) {
    const Crease& crease = creases_[foot.crease];
    const InstanceColumns& ground = all[foot.ground.instance];
    if (ground.vertices_.empty()) continue;
    const std::uint32_t beside =
        ground.mesh_.locate(foot.ground.triangle, foot.ground.barycentric).slot;
    const glm::dvec3 up(foot.ground.normal);
    const double half_m = 0.5 * glm::distance(crease.begin_m, crease.end_m);
    for (std::size_t e = 0; e < 2; ++e) {
      const std::uint32_t a = crease.own[e];
      if (column_of_[a] == kNone) continue;
      const double own_depth_m = depth_m(a, all);
      const ColumnCells& wall = cells(a);
      const Measured& own = measured_[column_of_[a]];
      const glm::dvec3 foot_m =
          place_m_[a] + 0.25 * (crease.begin_m + crease.end_m - 2.0 * place_m_[a]);
      // Go through the depth of the wall. The ground below takes up the heat through the upper half
      // of its first cell.
      for (std::size_t k = 0; k < kPoints * wall.count; ++k) {
        const std::size_t l = k / kPoints;
        const double part_m = wall.thickness_m(l) / kPoints;
        const double top_m = wall.top_m[l] + static_cast<double>(k % kPoints) * part_m;
        const double area_m2 = half_m * part_m * share_above(top_m, top_m + part_m, own_depth_m) *
                               std::clamp(own.held_m2[l] / own.area_m2, 0.0, 1.0);
        const glm::dvec3 under_m = foot_m - (top_m + 0.5 * part_m) * glm::dvec3(samples_[a].normal);
        std::array<double, 3> weight{};
        const std::uint32_t slot = ground.locate(beside, under_m, weight);
        if (slot == kNone) continue;
        // Ground that begins beside the wall lies open.
        const auto& leaf = ground.leaf(slot);
        const auto under = [&](std::size_t corner) {
          const SurfaceSample& below = ground.samples_[leaf[corner]];
          return below.covered ||
                 below.foot_m <
                     kBesideOffsets * ray_offsets(below.position_m, below.facet_m).around_m;
        };
        std::size_t corner = 0;
        for (std::size_t i = 1; i < 3; ++i) {
          if (std::pair(under(i), weight[i]) > std::pair(under(corner), weight[corner])) corner = i;
        }
        const std::uint32_t b = leaf[corner];
        if (ground.column_of_[b] == kNone) continue;
        const double height_m =
            std::max(kLeastThickness * wall.thickness_m(l), glm::dot(own.middle_m[l] - foot_m, up));
        const double resistance =
            height_m / wall.conductivity_w_m_k[l] + 0.5 * ground.cells(b).resistance_m2k_w[0] +
            in_.joints.resistance_m2k_w(object_, in_.materials[samples_[a].material],
                                        ground.object_, in_.materials[ground.samples_[b].material]);
        visit(static_cast<std::uint32_t>(column_of_[a] * kMaxColumnCells + l), foot.ground.instance,
              static_cast<std::uint32_t>(ground.column_of_[b] * kMaxColumnCells),
              area_m2 / resistance);
      }
    }
  }
}

}  // namespace emit::renderer::columns
