// SPDX-License-Identifier: Apache-2.0
// Cells of columns: their volumes, areas and middles, and the conductances between those of one
// body.
#include <algorithm>
#include <cmath>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/geometric.hpp>

#include "surface/rays/ray_offsets.hpp"
#include "surface/warm_up/instance_columns.hpp"

namespace emit::renderer::columns {
namespace {

/// Least share of a cell that a column keeps. Less is as good as nothing, and the cell remains part
/// of the balance.
constexpr double kLeastShare = 1e-3;
/// Distance between samples at one place on faces without a crease, in widths of their columns.
constexpr double kSeamWays = 0.125;
/// Steps from triangle to triangle after which the search for a point across a crease gives up.
constexpr int kMostSteps = 400;

}  // namespace

InstanceColumns::InstanceColumns(const SurfaceInputs& inputs, const SurfaceModel& model,
                                 std::uint32_t instance)
    : in_(inputs),
      object_(inputs.geometry.instances[instance].object),
      heat_(*inputs.heat.foster()),
      mesh_(model.meshes[inputs.geometry.instances[instance].mesh]),
      samples_(std::span(model.samples.samples)
                   .subspan(model.first_sample[instance], mesh_.vertices().size())) {
  const scene::Instance& own = inputs.geometry.instances[instance];
  // Take the axes of the samples: rel for static surfaces, else those of the body.
  const bool fixed = inputs.entity_of_object[own.object] < 0;
  glm::dmat4 from_mesh = fixed ? own.world_from_mesh : own.body_from_mesh;
  if (fixed) from_mesh[3] -= glm::dvec4(inputs.rays.origin_world_m(), 0.0);
  leaves_.reserve(mesh_.leaf_count());
  for (std::uint32_t slot = 0; slot < mesh_.leaf_count(); ++slot) {
    leaves_.push_back(mesh_.leaf(slot));
  }
  for (const RefinedMesh::Vertex& vertex : mesh_.vertices()) {
    place_m_.emplace_back(from_mesh * glm::dvec4(glm::dvec3(vertex.position_m), 1.0));
  }
}

void InstanceColumns::find() {
  find_creases();
  find_near();
  if (vertices_.empty()) return;
  make_delaunay();
  measure_cells();
  link_along();
  link_across();
  link_seams();
  join_pairs(pairs_);
}

SampleColumn InstanceColumns::column(std::size_t index) const {
  const Measured& own = measured_[index];
  const ColumnCells& stack = cells(vertices_[index]);
  SampleColumn out;
  for (std::size_t l = 0; l < stack.count; ++l) {
    const double share = std::max(kLeastShare, own.held_m2[l] / own.area_m2);
    const double below_w_m2_k =
        std::max(kLeastShare * stack.below_w_m2_k(l), own.below_w_k[l] / own.area_m2);
    out.share_frac[l] = static_cast<float>(share);
    out.below_w_m2_k[l] = static_cast<float>(below_w_m2_k);
  }
  return out;
}

bool InstanceColumns::under_a_solid(const glm::dvec3& at_m, std::uint32_t beside) const {
  const SurfaceSample& own = samples_[beside];
  const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
  const CasterRay ray{glm::vec3(at_m) + 2.0F * offset_m * own.normal, own.normal};
  std::array<CasterHit, 1> hit;
  return in_.places.first_hits({&ray, 1}, {true, {}}, hit) != 0U && !hit[0].front;
}

End InstanceColumns::end_below(const std::array<std::uint32_t, 3>& leaf,
                               const glm::dvec3& at_m) const {
  End end;
  for (const std::uint32_t v : leaf) {
    for (std::size_t k = 0; k < near_[v].count; ++k) {
      const std::uint32_t index = near_[v].near[k].crease;
      const Crease& crease = creases_[index];
      if (!(crease.slant > 0.0)) continue;
      // The piece that is nearest to the vertex stands for its neighbours too.
      const double away_m = distance_m(crease, at_m, glm::distance(at_m, place_m_[v]));
      if (away_m / crease.slant < end.depth_m) end = {away_m / crease.slant, index, away_m};
    }
  }
  return end;
}

void InstanceColumns::expose(std::uint32_t slot) {
  const auto leaf = this->leaf(slot);
  const auto covered = [&](std::uint32_t v) { return samples_[v].covered; };
  const auto count = std::ranges::count_if(leaf, covered);
  if (count == 3) return;
  // A foot may cut the leaf, or run along its sides.
  const glm::dvec3 centre = centre_m(slot);
  const bool cut = std::ranges::any_of(leaf, [&](std::uint32_t v) {
    return covered(v) ||
           static_cast<double>(samples_[v].foot_m) < 2.0 * glm::distance(place_m_[v], centre);
  });
  for (std::size_t k = 0; k < 3; ++k) {
    each_point(slot, k, [&](const glm::dvec3& at_m, double area_m2) {
      std::uint32_t taker = leaf[k];
      if (cut && samples_[taker].entity < 0) {
        if (under_a_solid(at_m, taker)) return;
        // Take the nearest open corner.
        for (const std::uint32_t v : leaf) {
          if (covered(v)) continue;
          if (covered(taker) ||
              glm::distance(place_m_[v], at_m) < glm::distance(place_m_[taker], at_m)) {
            taker = v;
          }
        }
      }
      if (covered(taker) || column_of_[taker] == kNone) return;
      measured_[column_of_[taker]].exposed_m2 += area_m2;
    });
  }
}

void InstanceColumns::measure_cells() {
  for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
    const auto leaf = this->leaf(slot);
    if (!any_column(leaf)) continue;
    expose(slot);
    const glm::dvec3 n = normal(slot);
    for (std::size_t k = 0; k < 3; ++k) {
      if (column_of_[leaf[k]] == kNone) continue;
      const ColumnCells& stack = cells(leaf[k]);
      Measured& own = measured_[column_of_[leaf[k]]];
      each_point(slot, k, [&](const glm::dvec3& at_m, double area_m2) {
        const double end_m = end_below(leaf, at_m).depth_m;
        own.area_m2 += area_m2;
        for (std::size_t l = 0; l < stack.count; ++l) {
          const double share = share_above(stack.top_m[l], stack.top_m[l + 1], end_m);
          own.held_m2[l] += area_m2 * share;
          // The rest of a cell beside the plane and its counterpart beyond make up a whole
          // cell, so that heat goes to its middle.
          const double next_m =
              l + 1 < stack.count ? stack.middle_m(l + 1) : stack.top_m[stack.count];
          own.below_w_k[l] +=
              area_m2 * stack.below_w_m2_k(l) * share_above(stack.middle_m(l), next_m, end_m);
          const double depth_m = stack.top_m[l] + 0.5 * share * stack.thickness_m(l);
          own.middle_m[l] += area_m2 * share * (at_m - depth_m * n);
        }
      });
    }
  }
  // Material behind a concave edge belongs to the columns on it, up to the plane between the
  // faces.
  for (const Crease& crease : creases_) {
    for (const std::uint32_t v : crease.own) {
      if (column_of_[v] == kNone) continue;
      if (crease.slant >= 0.0) continue;
      Measured& own = measured_[column_of_[v]];
      const ColumnCells& stack = cells(v);
      const glm::dvec3 n(samples_[v].normal);
      const double half_m = 0.5 * glm::distance(crease.begin_m, crease.end_m);
      const glm::dvec3 along_m = 0.25 * (crease.begin_m + crease.end_m - 2.0 * place_m_[v]);
      for (std::size_t l = 0; l < stack.count; ++l) {
        const double back_m = -crease.slant * stack.middle_m(l);
        own.held_m2[l] += back_m * half_m;
        own.below_w_k[l] += -crease.slant * stack.top_m[l + 1] * half_m * stack.below_w_m2_k(l);
        own.middle_m[l] +=
            back_m * half_m *
            (place_m_[v] + along_m - 0.5 * back_m * crease.inward - stack.middle_m(l) * n);
      }
    }
  }
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    Measured& own = measured_[i];
    const std::uint32_t v = vertices_[i];
    const ColumnCells& stack = cells(v);
    for (std::size_t l = 0; l < stack.count; ++l) {
      if (own.held_m2[l] > 0.0) {
        own.middle_m[l] /= own.held_m2[l];
      } else {
        own.middle_m[l] = place_m_[v] - stack.middle_m(l) * glm::dvec3(samples_[v].normal);
      }
    }
  }
}

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
      halves.push_back({std::min(a, b), std::max(a, b),
                        0.5 * glm::dot(to_a, to_b) / sine * glm::distance(place_m_[a], place_m_[b]),
                        end_below(leaf, 0.5 * (middle + centre)).depth_m});
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
        const double area_m2 =
            0.5 * length_m * cells(a).thickness_m(l) * std::sqrt(1.0 + crease.slant * crease.slant);
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
      const double width_m = -crease.slant * cells(a).middle_m(l);
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
