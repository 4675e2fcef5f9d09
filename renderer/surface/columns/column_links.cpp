// SPDX-License-Identifier: Apache-2.0
// Conductances between the cells of columns of one body.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <utility>
#include <vector>

#include "surface/columns/instance_columns.hpp"

namespace emit::renderer::columns {
namespace {

/// Distance between samples at one place on faces without a crease, in widths of their columns.
constexpr double kSeamWays = 0.125;
/// Steps from triangle to triangle after which the search for a point across a crease gives up.
constexpr int kMostSteps = 400;

}  // namespace

/// Joins conductances between the same cells.
void join_pairs(std::vector<Pair>& pairs) {
  std::ranges::stable_sort(pairs, {}, [](const Pair& p) { return std::pair(p.a, p.b); });
  std::vector<Pair> out;
  for (const Pair& pair : pairs) {
    if (!out.empty() && out.back().a == pair.a && out.back().b == pair.b) {
      out.back().conductance_w_k += pair.conductance_w_k;
    } else {
      out.push_back(pair);
    }
  }
  pairs = std::move(out);
}

void InstanceColumns::add(std::uint32_t a, std::size_t l, std::uint32_t b, std::size_t m,
                          double conductance_w_k) {
  if (!(conductance_w_k > 0.0)) return;
  auto one = static_cast<std::uint32_t>(column_of_[a] * kMaxColumnCells + l);
  auto other = static_cast<std::uint32_t>(column_of_[b] * kMaxColumnCells + m);
  if (one > other) std::swap(one, other);
  pairs_.push_back({one, other, conductance_w_k});
}

void InstanceColumns::link_along() {
  struct Half {
    std::uint32_t a = 0;
    std::uint32_t b = 0;
    double width_m = 0.0;
    double end_m = 0.0;
  };
  std::vector<Half> halves;
  for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
    const auto& leaf = this->leaf(slot);
    if (!any_column(leaf)) continue;
    const glm::dvec3 centre = centre_m(slot);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = leaf[k];
      const std::uint32_t b = leaf[(k + 1) % 3];
      if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
      // The face between two vertices ends at the centre of the circle around the leaf.
      const glm::dvec3& top_m = place_m_[leaf[(k + 2) % 3]];
      const glm::dvec3 to_a = place_m_[a] - top_m;
      const glm::dvec3 to_b = place_m_[b] - top_m;
      const double sine = glm::length(glm::cross(to_a, to_b));
      if (!(sine > 0.0)) continue;
      const glm::dvec3 middle = 0.5 * (place_m_[a] + place_m_[b]);
      const double opposite_m = std::max(opposite_[a].depth_m, opposite_[b].depth_m);
      halves.push_back({std::min(a, b), std::max(a, b),
                        0.5 * glm::dot(to_a, to_b) / sine * glm::distance(place_m_[a], place_m_[b]),
                        std::min(opposite_m, end_below(leaf, 0.5 * (middle + centre)).depth_m)});
    }
  }
  std::ranges::stable_sort(halves, {}, [](const Half& h) { return std::pair(h.a, h.b); });
  for (std::size_t i = 0; i < halves.size();) {
    const auto [a, b, w, e] = halves[i];
    std::size_t end = i + 1;
    while (end < halves.size() && halves[end].a == a && halves[end].b == b) ++end;
    const std::span<const Half> both = std::span(halves).subspan(i, end - i);
    const glm::dvec3 way_m = place_m_[b] - place_m_[a];
    const double length_m = glm::length(way_m);
    each_beside(a, b, [&](std::size_t l, std::size_t m, double thickness_m) {
      // Sum up both sides of the edge; a face of negative width conducts nothing.
      double width_m = 0.0;
      for (const Half& half : both) {
        width_m += half.width_m * share_above(cells(a).top_m[l], cells(a).top_m[l + 1], half.end_m);
      }
      const double k_a = cells(a).conductivity_w_m_k[l];
      const double k_b = cells(b).conductivity_w_m_k[m];
      add(a, l, b, m, 2.0 * k_a * k_b / (k_a + k_b) * width_m * thickness_m / length_m);
    });
    i = end;
  }
}

std::uint32_t InstanceColumns::locate(std::uint32_t slot, const glm::dvec3& at_m,
                                      std::array<double, 3>& weight) const {
  for (int step = 0; step < kMostSteps; ++step) {
    const auto& leaf = this->leaf(slot);
    const glm::dvec3 n_m2 = area_vector_m2(slot);
    const double area_m4 = glm::dot(n_m2, n_m2);
    if (!(area_m4 > 0.0)) return kNone;
    std::size_t least = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3& from_m = place_m_[leaf[(k + 1) % 3]];
      const glm::dvec3& to_m = place_m_[leaf[(k + 2) % 3]];
      weight[k] = 0.5 * glm::dot(glm::cross(to_m - from_m, at_m - from_m), n_m2) / area_m4;
      if (weight[k] < weight[least]) least = k;
    }
    constexpr double kInside = -1e-6;
    if (weight[least] >= kInside) return slot;
    const std::uint32_t next = beside_[3 * slot + (least + 1) % 3];
    if (next == kNone) {
      // Take the nearest place of the last leaf if the point lies just outside of the face.
      for (double& w : weight) w = std::max(w, 0.0);
      const double sum = weight[0] + weight[1] + weight[2];
      for (double& w : weight) w /= sum;
      return slot;
    }
    slot = next;
  }
  return kNone;
}

void InstanceColumns::add_across(const Crease& crease, std::uint32_t a, std::size_t l,
                                 std::uint32_t b, std::size_t m, double area_m2) {
  const auto to_plane_m = [&](std::uint32_t v, std::size_t cell) {
    return std::max(kLeastThickness * cells(v).thickness_m(cell),
                    std::abs(glm::dot(middle_m(v, cell) - crease.begin_m, crease.between)));
  };
  const double resistance = to_plane_m(a, l) / cells(a).conductivity_w_m_k[l] +
                            to_plane_m(b, m) / cells(b).conductivity_w_m_k[m];
  add(a, l, b, m, 0.5 * area_m2 / resistance);
}

void InstanceColumns::link_across() {
  for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
    const auto leaf = this->leaf(slot);
    if (!any_column(leaf)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = leaf[k];
      if (column_of_[a] == kNone) continue;
      each_point(slot, k, [&](const glm::dvec3& at_m, double area_m2) {
        const End end = end_below(leaf, at_m);
        if (opposite_[a].depth_m < end.depth_m) {
          add_through(a, slot, at_m, area_m2);
          return;
        }
        if (end.crease == kNone || end.depth_m >= thickness_m(a)) return;
        const Crease& crease = creases_[end.crease];
        // Find the same place on the other face.
        const glm::dvec3 mirrored_m =
            at_m - end.distance_m * crease.inward + end.distance_m * crease.across;
        std::array<double, 3> weight{};
        const std::uint32_t found = locate(crease.other_slot, mirrored_m, weight);
        if (found == kNone) return;
        const double tilted_m2 = area_m2 * std::sqrt(1.0 + 1.0 / (crease.slant * crease.slant));
        const std::size_t l = cells(a).at(end.depth_m);
        // It belongs to the corner with the greatest share. To spread it over all three would
        // carry heat along the surface.
        const auto corner =
            static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin());
        const std::uint32_t b = this->leaf(found)[corner];
        if (column_of_[b] == kNone) return;
        add_across(crease, a, l, b, cells(b).at(end.depth_m), tilted_m2);
      });
    }
  }
  for (const Crease& crease : creases_) {
    if (crease.slant >= 0.0) continue;
    const double length_m = glm::distance(crease.begin_m, crease.end_m);
    for (std::size_t e = 0; e < 2; ++e) {
      const std::uint32_t a = crease.own[e];
      const std::uint32_t b = crease.other[e];
      if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
      for (std::size_t l = 0; l < cells(a).count; ++l) {
        const double area_m2 = share_behind(crease, e, cells(a).top_m[l], cells(a).top_m[l + 1]) *
                               0.5 * length_m * cells(a).thickness_m(l) *
                               std::sqrt(1.0 + crease.slant * crease.slant);
        add_across(crease, a, l, b, cells(b).at(cells(a).middle_m(l)), area_m2);
      }
    }
    // The material behind the edge conducts along it too.
    const std::uint32_t a = crease.own[0];
    const std::uint32_t b = crease.own[1];
    if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
    each_beside(a, b, [&](std::size_t l, std::size_t m, double thickness_m) {
      const double k_a = cells(a).conductivity_w_m_k[l];
      const double k_b = cells(b).conductivity_w_m_k[m];
      const double top_m = cells(a).top_m[l];
      const double bottom_m = cells(a).top_m[l + 1];
      const double width_m = -crease.slant * cells(a).middle_m(l) *
                             std::min(share_behind(crease, 0, top_m, bottom_m),
                                      share_behind(crease, 1, top_m, bottom_m));
      add(a, l, b, m, 2.0 * k_a * k_b / (k_a + k_b) * width_m * thickness_m / length_m);
    });
  }
}

void InstanceColumns::link_seams() {
  for (const auto& [a, b] : seams_) {
    if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
    each_beside(a, b, [&](std::size_t l, std::size_t m, double thickness_m) {
      const double k_a = cells(a).conductivity_w_m_k[l];
      const double k_b = cells(b).conductivity_w_m_k[m];
      add(a, l, b, m, 2.0 * k_a * k_b / (k_a + k_b) * thickness_m / kSeamWays);
    });
  }
}

}  // namespace emit::renderer::columns
