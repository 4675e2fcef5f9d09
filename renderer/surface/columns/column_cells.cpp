// SPDX-License-Identifier: Apache-2.0
// Cells of columns: their volumes, areas and middles.
#include <algorithm>
#include <cmath>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "surface/columns/instance_columns.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer::columns {
namespace {

/// Least share of a cell that a column keeps. Less is as good as nothing, and the cell remains part
/// of the balance.
constexpr double kLeastShare = 1e-3;

}  // namespace

InstanceColumns::InstanceColumns(const SurfaceInputs& inputs, const SurfaceModel& model,
                                 std::uint32_t instance)
    : in_(inputs),
      instance_(instance),
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
    low_m_ = glm::min(low_m_, place_m_.back());
    high_m_ = glm::max(high_m_, place_m_.back());
  }
  if (!fixed) {
    const auto entity = static_cast<std::size_t>(inputs.entity_of_object[own.object]);
    alone_.resize(entity + 1);
    for (EntityPlacement& each : alone_) each.on = false;
    alone_.back().on = true;
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

bool InstanceColumns::closed_in(const SurfaceSample& sample) const {
  constexpr float kClosedFrac = 0.01F;
  if (sample.sky_frac > kClosedFrac) return false;
  const float offset_m = ray_offsets(sample.position_m, sample.facet_m).around_m;
  const glm::vec3 n = sample.normal;
  const glm::vec3 u = glm::normalize(glm::cross(
      n, std::abs(n.z) < 0.9F ? glm::vec3(0.0F, 0.0F, 1.0F) : glm::vec3(1.0F, 0.0F, 0.0F)));
  const glm::vec3 v = glm::cross(n, u);
  // Spread the rays like the light of a face that is equally bright from all sides.
  std::array<CasterRay, CasterRays::kMaxRays> rays;
  std::array<CasterHit, CasterRays::kMaxRays> hits;
  constexpr float kGoldenRad = 2.3999632F;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const float sine = std::sqrt((static_cast<float>(i) + 0.5F) / static_cast<float>(rays.size()));
    const float turn = kGoldenRad * static_cast<float>(i);
    rays[i] = {
        sample.position_m + 2.0F * offset_m * n,
        sine * (std::cos(turn) * u + std::sin(turn) * v) + std::sqrt(1.0F - sine * sine) * n};
  }
  if (in_.places.first_hits(rays, around(), hits) != CasterRays::kAllRays) return false;
  const double beyond_m = kBesideOffsets * static_cast<double>(offset_m);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const glm::dvec3 at_m(rays[i].origin_m + hits[i].distance_m * rays[i].direction);
    if (glm::any(glm::lessThan(at_m, low_m_ - beyond_m)) ||
        glm::any(glm::greaterThan(at_m, high_m_ + beyond_m))) {
      return false;
    }
  }
  return true;
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

double InstanceColumns::share_behind(const Crease& crease, std::size_t e, double top_m,
                                     double bottom_m) const {
  const std::uint32_t v = crease.own[e];
  const glm::dvec3 half_m = 0.5 * (crease.begin_m + crease.end_m) - place_m_[v];
  double sum = 0.0;
  for (std::size_t i = 0; i < kPoints; ++i) {
    const glm::dvec3 at_m = place_m_[v] + (static_cast<double>(i) + 0.5) / kPoints * half_m;
    sum += share_above(top_m, bottom_m, end_below({v, v, v}, at_m).depth_m);
  }
  return sum / static_cast<double>(kPoints);
}

double InstanceColumns::below_w_m2_k(const ColumnCells& stack, std::size_t l, double crease_m,
                                     double opposite_m) noexcept {
  // Nothing lies below the middle of a thin solid.
  const bool thin = opposite_m <= stack.top_m[stack.count] / kReachedFrac;
  if (thin && l >= cell_above(stack, opposite_m)) return 0.0;
  if (opposite_m < crease_m) {
    const double next = share_above(stack.top_m[l + 1], stack.top_m[l + 2], opposite_m);
    return 2.0 / (stack.resistance_m2k_w[l] + next * stack.resistance_m2k_w[l + 1]);
  }
  // The rest of a cell beside the plane of a crease and its counterpart beyond make up a whole
  // cell, so that heat goes to its middle.
  const double next_m = l + 1 < stack.count ? stack.middle_m(l + 1) : stack.top_m[stack.count];
  return stack.below_w_m2_k(l) * share_above(stack.middle_m(l), next_m, crease_m);
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
        const double crease_m = end_below(leaf, at_m).depth_m;
        const double opposite_m = opposite_[leaf[k]].depth_m;
        const double end_m = std::min(crease_m, opposite_m);
        own.area_m2 += area_m2;
        for (std::size_t l = 0; l < stack.count; ++l) {
          const double share = share_above(stack.top_m[l], stack.top_m[l + 1], end_m);
          own.held_m2[l] += area_m2 * share;
          own.below_w_k[l] += area_m2 * below_w_m2_k(stack, l, crease_m, opposite_m);
          const double depth_m = stack.top_m[l] + 0.5 * share * stack.thickness_m(l);
          own.middle_m[l] += area_m2 * share * (at_m - depth_m * n);
        }
      });
    }
  }
  // Material behind a concave edge belongs to the columns on it, up to the plane between the
  // faces.
  for (const Crease& crease : creases_) {
    if (crease.slant >= 0.0) continue;
    for (std::size_t e = 0; e < 2; ++e) {
      const std::uint32_t v = crease.own[e];
      if (column_of_[v] == kNone) continue;
      Measured& own = measured_[column_of_[v]];
      const ColumnCells& stack = cells(v);
      const glm::dvec3 n(samples_[v].normal);
      const double half_m = 0.5 * glm::distance(crease.begin_m, crease.end_m);
      const glm::dvec3 along_m = 0.25 * (crease.begin_m + crease.end_m - 2.0 * place_m_[v]);
      for (std::size_t l = 0; l < stack.count; ++l) {
        const double back_m = -crease.slant * stack.middle_m(l);
        const double share = share_behind(crease, e, stack.top_m[l], stack.top_m[l + 1]);
        const double next_m =
            l + 1 < stack.count ? stack.middle_m(l + 1) : stack.top_m[stack.count];
        own.held_m2[l] += share * back_m * half_m;
        own.below_w_k[l] += share_behind(crease, e, stack.middle_m(l), next_m) * -crease.slant *
                            stack.top_m[l + 1] * half_m * stack.below_w_m2_k(l);
        own.middle_m[l] +=
            share * back_m * half_m *
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
