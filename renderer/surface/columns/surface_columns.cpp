// SPDX-License-Identifier: Apache-2.0
#include "surface/columns/surface_columns.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "emit/threads/parallel.hpp"
#include "surface/columns/instance_columns.hpp"

namespace emit::renderer {
namespace {

using columns::InstanceColumns;
using columns::Pair;
using physics::kMaxColumnCells;
/// Greatest distance from the foot of a solid within which the surface beside and under it has
/// columns, in m: heat spreads over 0.4 m of soil or asphalt in three days.
constexpr double kFootReachM = 0.5;

/// Lays out the columns and links of all instances in the model.
void lay_out(std::span<const InstanceColumns> found, SurfaceModel& model) {
  SurfaceSamples& all = model.samples;
  // Number the columns of all instances, and collect their conductances.
  std::vector<std::uint32_t> first;
  std::vector<double> area_m2;
  for (const InstanceColumns& each : found) {
    first.push_back(static_cast<std::uint32_t>(area_m2.size()));
    for (std::size_t c = 0; c < each.vertices().size(); ++c) area_m2.push_back(each.area_m2(c));
  }
  const auto cell = [&](std::size_t instance, std::uint32_t own) {
    return first[instance] * static_cast<std::uint32_t>(kMaxColumnCells) + own;
  };
  std::vector<Pair> pairs;
  std::vector<std::uint8_t> at_feet(found.size(), 0);
  for (std::size_t p = 0; p < found.size(); ++p) {
    if (found[p].any_at_foot()) at_feet[p] = 1;
    for (const Pair& pair : found[p].pairs()) {
      pairs.push_back({cell(p, pair.a), cell(p, pair.b), pair.conductance_w_k});
    }
    found[p].each_foot(found, [&](std::uint32_t own, std::uint32_t ground, std::uint32_t under,
                                  double conductance_w_k) {
      if (!(conductance_w_k > 0.0)) return;
      at_feet[p] = at_feet[ground] = 1;
      const std::uint32_t a = cell(p, own);
      const std::uint32_t b = cell(ground, under);
      pairs.push_back({std::min(a, b), std::max(a, b), conductance_w_k});
    });
  }
  columns::join_pairs(pairs);
  // Count the links of each cell, and lay them out in the order of the cells.
  const auto each_link = [&](const auto& visit) {
    for (const Pair& pair : pairs) {
      visit(pair.a, pair.b, pair.conductance_w_k);
      visit(pair.b, pair.a, pair.conductance_w_k);
    }
  };
  std::vector<std::uint32_t> at(area_m2.size() * kMaxColumnCells + 1, 0);
  each_link([&](std::uint32_t own, std::uint32_t, double) { ++at[own + 1]; });
  for (std::size_t i = 1; i < at.size(); ++i) at[i] += at[i - 1];
  for (std::size_t p = 0; p < found.size(); ++p) {
    const std::uint32_t first_sample = model.first_sample[p];
    for (std::size_t c = 0; c < found[p].vertices().size(); ++c) {
      SampleColumn column = found[p].column(c);
      column.sample = first_sample + found[p].vertices()[c];
      column.area_m2 = static_cast<float>(found[p].area_m2(c));
      const std::size_t index = first[p] + c;
      for (std::size_t l = 0; l <= kMaxColumnCells; ++l) {
        column.first_link[l] = at[index * kMaxColumnCells + l];
      }
      SurfaceSample& sample = all.samples[column.sample];
      sample.column = static_cast<std::uint32_t>(index);
      sample.exposed_frac = static_cast<float>(found[p].exposed_frac(c));
      sample.excess_frac = static_cast<float>(found[p].excess_frac(c));
      sample.felt_frac = at_feet[p] != 0 ? 0.0F : 1.0F;
      all.columns.push_back(column);
    }
    for (const std::uint32_t v : found[p].standing()) all.samples[first_sample + v].covered = true;
  }
  all.links.resize(at.back());
  each_link([&](std::uint32_t own, std::uint32_t other, double conductance_w_k) {
    all.links[at[own]++] = {other / static_cast<std::uint32_t>(kMaxColumnCells),
                            other % static_cast<std::uint32_t>(kMaxColumnCells),
                            static_cast<float>(conductance_w_k / area_m2[own / kMaxColumnCells])};
  });
}

}  // namespace

float foot_reach_m(const scene::Material& material) noexcept {
  if (material.prescribed_k || material.sheet) return 0.0F;
  double thickness_m = 0.0;
  for (const scene::Layer& layer : material.layers) thickness_m += layer.thickness_m;
  return static_cast<float>(std::min(kFootReachM, columns::kReachThicknesses * thickness_m));
}

void link_columns(const SurfaceInputs& inputs, SurfaceModel& model) {
  if (inputs.heat.foster() == nullptr) return;
  const std::size_t instances = inputs.geometry.instances.size();
  std::vector<InstanceColumns> found;
  found.reserve(instances);
  for (std::uint32_t p = 0; p < instances; ++p) found.emplace_back(inputs, model, p);
  threads::parallel_parts(instances, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t p = from; p < to; ++p) found[p].find();
  });
  lay_out(found, model);
}

}  // namespace emit::renderer
