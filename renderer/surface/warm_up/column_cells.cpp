// SPDX-License-Identifier: Apache-2.0
// Volumes, areas and middles of the cells of columns.
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

}  // namespace emit::renderer::columns
