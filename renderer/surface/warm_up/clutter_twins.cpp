// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/clutter_twins.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::renderer {
namespace {

/// Samples in one task of a parallel loop.
constexpr std::size_t kGrain = 256;

/// Finds the states of twins at the start of the history. Neighbours face alike and share the start
/// in the open.
void start_twins(const SurfaceInputs& inputs, const SurfaceSamples& all,
                 SampleHistories& histories) {
  const std::size_t count = all.samples.size() - all.first_twin;
  threads::parallel_parts(count, kGrain, [&](std::size_t from, std::size_t to) {
    std::uint32_t material = kNoSample;
    glm::vec3 facing{0.0F};
    SampleState known;
    for (std::size_t s = all.first_twin + from; s < all.first_twin + to; ++s) {
      const SurfaceSample& twin = all.samples[s];
      const glm::vec3 normal = inputs.record.rays.front().normal(twin);
      const auto make = [&] {
        return inputs.heat.open_start(twin, normal, inputs.history, inputs.record.tail);
      };
      if (material != twin.material || facing != normal) {
        material = twin.material;
        facing = normal;
        known = make();
      }
      histories.start[s] = known;
      if (inputs.history.starts_balanced(twin.material)) {
        inputs.heat.hide_start(twin, normal, inputs.history,
                               sun_share(inputs.record, twin, histories.rows[s].sun_frac,
                                         inputs.history.day_sun_j_m2(glm::dvec3(normal))),
                               histories.start[s]);
      }
      // Under a solid it has no heat of its own; see FosterHeat::begin_column().
      if (twin.covered && all.samples[twin.twin_of].column != kNoSample) {
        histories.start[s].modes_k = {};
      }
    }
  });
}

}  // namespace

void add_twins(const SurfaceInputs& inputs, SampleHistories& histories, SurfaceModel& model) {
  SurfaceSamples& all = model.samples;
  EMIT_CHECK(all.twinned.empty());
  // List the drawn samples that have twins.
  for (std::uint32_t s = 0; s < model.drawn_samples; ++s) {
    if (inputs.heat.first_twin(all.samples[s].material) != 0) all.twinned.push_back(s);
  }
  all.first_twin = static_cast<std::uint32_t>(all.samples.size());
  if (all.twinned.empty()) return;
  const std::size_t count = all.samples.size() + 2 * all.twinned.size();
  EMIT_CHECK_OP(count, <, std::size_t{std::numeric_limits<std::uint32_t>::max()});
  all.samples.reserve(count);
  histories.rows.reserve(count);
  // Append the low twins, then the high ones.
  for (std::uint32_t side = 0; side < 2; ++side) {
    const auto first = static_cast<std::uint32_t>(all.samples.size());
    for (const std::uint32_t s : all.twinned) {
      SurfaceSample twin = all.samples[s];
      twin.material = inputs.heat.first_twin(twin.material) + side;
      twin.twin_of = s;
      twin.column = kNoSample;
      twin.vertex = (1 + side) * model.drawn_samples + s;
      if (twin.other_side != kNoSample) {
        // The other face of a sheet has the same material, so it has a twin too.
        const auto other = std::ranges::lower_bound(all.twinned, twin.other_side);
        twin.other_side = first + static_cast<std::uint32_t>(other - all.twinned.begin());
      }
      all.samples.push_back(twin);
      histories.rows.push_back(histories.rows[s]);
    }
  }
  histories.start.resize(count);
  model.states.resize(count);
  model.outputs.resize(count);
  start_twins(inputs, all, histories);
}

}  // namespace emit::renderer
