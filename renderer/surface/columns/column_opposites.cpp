// SPDX-License-Identifier: Apache-2.0
// Faces of one solid whose stacks reach each other, and the heat that flows from one to the other.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "surface/columns/instance_columns.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer::columns {
namespace {

/// Cosine between the normals of two faces above which they are not opposite ones.
constexpr double kOppositeCos = -0.9;
/// Share of the last cell above the middle of a body that counts at least, so that no link is far
/// stronger than all others.
constexpr double kLeastShareThrough = 0.04;

}  // namespace

bool InstanceColumns::stands_near(std::uint32_t vertex) const {
  return std::ranges::any_of(std::span(near_[vertex].near).first(near_[vertex].count),
                             [&](const Near& n) { return creases_[n.crease].stands; });
}

void InstanceColumns::find_opposites() {
  opposite_.assign(mesh_.vertices().size(), {});
  for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
    const auto& leaf = this->leaf(slot);
    if (!conducts(leaf[0])) continue;
    const SurfaceSample& own = samples_[leaf[0]];
    const glm::vec3 n(normal(slot));
    const double deep_m = thickness_m(leaf[0]);
    const float offset_m = 2.0F * ray_offsets(own.position_m, own.facet_m).around_m;
    const CasterRay ray{glm::vec3(centre_m(slot)) - offset_m * n, -n};
    std::array<CasterHit, 1> hit;
    const auto within_m = static_cast<float>(2.0 * deep_m / kReachedFrac);
    if (in_.places.first_hits({&ray, 1}, around(), hit, within_m) == 0U) continue;
    if (hit[0].front || hit[0].instance != instance_) continue;
    if (!(glm::dot(hit[0].normal, n) < static_cast<float>(kOppositeCos))) continue;
    const RefinedMesh::Place there = mesh_.locate(hit[0].triangle, hit[0].barycentric);
    const double half_m = 0.5 * static_cast<double>(hit[0].distance_m + offset_m);
    const auto& other = this->leaf(there.slot);
    // A face in a closed cavity has the core of the body behind it, and one that stands on ground
    // has no column.
    const bool reached = std::ranges::all_of(other, [&](std::uint32_t v) {
      return conducts(v) && !samples_[v].covered && !stands_near(v) &&
             thickness_m(v) > kReachedFrac * half_m && !closed_in(samples_[v]);
    });
    if (!reached || own.covered || closed_in(own)) continue;
    for (const std::uint32_t v : leaf) {
      if (half_m < opposite_[v].depth_m) opposite_[v] = {half_m, there.slot};
    }
  }
}

void InstanceColumns::add_through(std::uint32_t a, std::uint32_t slot, const glm::dvec3& at_m,
                                  double area_m2) {
  const Opposite& opposite = opposite_[a];
  const glm::dvec3 n = normal(slot);
  std::array<double, 3> weight{};
  const std::uint32_t found = locate(opposite.slot, at_m - 2.0 * opposite.depth_m * n, weight);
  if (found == kNone) return;
  const auto corner = static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin());
  const std::uint32_t b = leaf(found)[corner];
  if (column_of_[b] == kNone || opposite_[b].slot == kNone) return;
  const auto to_middle_m2k_w = [&](std::uint32_t v, std::size_t l) {
    const double share = share_above(cells(v).top_m[l], cells(v).top_m[l + 1], opposite.depth_m);
    return 0.5 * std::max(kLeastShareThrough, share) * cells(v).resistance_m2k_w[l];
  };
  const std::size_t l = cell_above(cells(a), opposite.depth_m);
  const std::size_t m = cell_above(cells(b), opposite.depth_m);
  // The other half comes from the other side.
  add(a, l, b, m, 0.5 * area_m2 / (to_middle_m2k_w(a, l) + to_middle_m2k_w(b, m)));
}

}  // namespace emit::renderer::columns
