// SPDX-License-Identifier: Apache-2.0
#include "surface/model/body_nodes.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/relaxation.hpp"
#include "surface/model/vertex_areas.hpp"

namespace emit::renderer {
namespace {

/// Film of convection and radiation that estimates the faces' answer. It changes how fast passes
/// converge, not what they converge to.
constexpr double kFilmW_m2_k = 19.0;

}  // namespace

std::size_t name_bodies(const scene::SceneGeometry& geometry, const SampleHeat& heat,
                        SurfaceModel& model) {
  std::vector<SurfaceSample>& all = model.samples.samples;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int32_t> bodies;
  for (std::size_t p = 0; p < geometry.instances.size(); ++p) {
    const scene::Instance& instance = geometry.instances[p];
    const std::size_t first = model.first_sample[p];
    const std::size_t vertices = model.meshes[instance.mesh].vertices().size();
    for (std::size_t s = first; s < first + vertices; ++s) {
      if (!heat.rests_on_body(all[s].material)) continue;
      const auto body = bodies.try_emplace({instance.object, instance.placement},
                                           static_cast<std::int32_t>(bodies.size()));
      all[s].body = body.first->second;
    }
  }
  return bodies.size();
}

BodyNodes::BodyNodes(const SurfaceModel& model, const scene::SceneGeometry& geometry,
                     const SampleHeat& heat)
    : heat_(&heat) {
  const std::vector<SurfaceSample>& all = model.samples.samples;
  std::int32_t last = -1;
  for (const SurfaceSample& sample : all) last = std::max(last, sample.body);
  if (last < 0) return;
  nodes_.resize(static_cast<std::size_t>(last) + 1);
  area_m2_.resize(all.size());
  // Sum the areas and conductances of each body.
  std::vector<std::pair<std::int32_t, std::uint32_t>> members;
  for (std::size_t p = 0; p < geometry.instances.size(); ++p) {
    const scene::Instance& instance = geometry.instances[p];
    const std::vector<float> area_m2 = vertex_areas_m2(model.meshes[instance.mesh], instance);
    for (std::uint32_t v = 0; v < area_m2.size(); ++v) {
      const std::uint32_t s = model.first_sample[p] + v;
      if (all[s].body < 0) continue;
      const scene::BodyInterior interior = instance.object < geometry.interiors.size()
                                               ? geometry.interiors[instance.object]
                                               : scene::BodyInterior{};
      Node& node = nodes_[static_cast<std::size_t>(all[s].body)];
      const BaseConductance faces = heat.of_bodies().base_conductance(all[s].material);
      const double area = area_m2[v];
      node.heat_j_k += interior.heat_j_m2_k * area;
      node.ventilation_w_k += interior.ventilation_w_m2_k * area;
      node.conductance_w_k += faces.sudden_w_m2_k * area;
      node.answer_w_k +=
          faces.steady_w_m2_k * area * faces.steady_w_m2_k / (faces.steady_w_m2_k + kFilmW_m2_k);
      area_m2_[s] = area_m2[v];
      members.emplace_back(all[s].body, s);
    }
  }
  // List the samples body by body.
  std::ranges::sort(members);
  for (const auto& [body, sample] : members) {
    Node& node = nodes_[static_cast<std::size_t>(body)];
    if (node.members++ == 0) node.first_member = static_cast<std::uint32_t>(members_.size());
    members_.push_back(sample);
  }
}

void BodyNodes::sum_inflow(const SurfaceSamples& all, std::span<const SampleState> states,
                           std::span<double> out_w) const noexcept {
  EMIT_CHECK_OP(out_w.size(), >=, nodes_.size());
  for (std::size_t b = 0; b < nodes_.size(); ++b) {
    const Node& node = nodes_[b];
    double sum_w = 0.0;
    for (std::uint32_t k = 0; k < node.members; ++k) {
      const std::uint32_t s = members_[node.first_member + k];
      sum_w += inflow_w(all, s, states[s]);
    }
    out_w[b] = sum_w;
  }
}

BodyNodes::Course BodyNodes::advance(const Node& node, double answer_w_k, double from_k,
                                     const End& begin, const End& end, double dt_s) noexcept {
  const double losses_w_k = node.conductance_w_k - answer_w_k + node.ventilation_w_k;
  if (!(losses_w_k > 0.0) || !(dt_s > 0.0)) return {from_k, from_k};
  const auto target_k = [&](const End& at) {
    return (at.inflow_w - answer_w_k * at.assumed_k + node.ventilation_w_k * at.air_k) / losses_w_k;
  };
  const double tau_s = node.heat_j_k / losses_w_k;
  const physics::RelaxationGains<double> gains = physics::relaxation_gains(dt_s, tau_s);
  const double begin_k = target_k(begin);
  const double end_k = target_k(end);
  const double change_k = (begin_k - from_k) * gains.start_frac + (end_k - from_k) * gains.end_frac;
  return {from_k + change_k, 0.5 * (begin_k + end_k) - tau_s / dt_s * change_k};
}

BodyNodes::Course BodyNodes::advance(std::size_t body, double from_k, const End& begin,
                                     const End& end, double dt_s) const noexcept {
  return advance(nodes_[body], 0.0, from_k, begin, end, dt_s);
}

BodyNodes::Course BodyNodes::correct(std::size_t body, double from_k, const End& begin,
                                     const End& end, double dt_s) const noexcept {
  return advance(nodes_[body], nodes_[body].answer_w_k, from_k, begin, end, dt_s);
}

double BodyNodes::balance_k(std::size_t body, const End& now) const noexcept {
  const Node& node = nodes_[body];
  return (now.inflow_w + node.ventilation_w_k * now.air_k) /
         (node.conductance_w_k + node.ventilation_w_k);
}

}  // namespace emit::renderer
