// SPDX-License-Identifier: Apache-2.0
#include "surface/run/surface_interval.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "emit/physics/check.hpp"
#include "surface/run/node_grid.hpp"

namespace emit::renderer {

namespace {

/// Share of the time in which samples advance, if there are columns whose heat is found afterwards,
/// and the share at which that is done at the latest.
constexpr double kSamplesFrac = 0.5;
constexpr double kColumnsFrac = 0.9;
/// Share of the time in which temperatures are found, if samples see each other in band afterwards.
constexpr double kHeatFrac = 0.85;

/// Returns the part of `count` that is due.
std::size_t due(double passed_frac, std::size_t count) noexcept {
  return static_cast<std::size_t>(
      std::ceil(std::clamp(passed_frac, 0.0, 1.0) * static_cast<double>(count)));
}

/// Returns true if the host has changed the weather at an instant or within the time before it in
/// which ground answers along a curve.
bool weather_changed(std::int64_t at_ns, const Environment& environment) noexcept {
  constexpr std::int64_t kAnswerNs = 30'000'000'000;
  const std::span<const std::int64_t> changes_ns = environment.changes_ns();
  const auto after = std::ranges::upper_bound(changes_ns, at_ns + NodeGrid::kSameNs);
  return after != changes_ns.begin() && at_ns - *(after - 1) <= kAnswerNs;
}

}  // namespace

double FrameShares::passed_frac(std::int64_t now_ns) const noexcept {
  const auto length_ns = static_cast<double>(std::max<std::int64_t>(1, end_ns - begin_ns));
  return std::clamp(static_cast<double>(now_ns - begin_ns) / length_ns, 0.0, 1.0);
}

void FrameShares::move_back(std::int64_t frames) noexcept {
  const std::int64_t step_ns = (end_ns - begin_ns) / frames;
  begin_ns -= step_ns;
  end_ns -= step_ns;
}

SurfaceInterval::SurfaceInterval(const SurfaceGeometry& geometry, const SampleHeat& heat)
    : geometry_(geometry),
      heat_(heat),
      rays_(geometry.entity_radii_m(), heat.sky_measure()),
      interval_(heat.sized_interval()) {
  interval_.entities.airs.resize(geometry.entities());
}

void SurfaceInterval::reset(const SurfaceModel& model, std::vector<EntityAnchor> anchors,
                            bool exchange, std::uint32_t turn, const BandLights* lights) {
  turn_ = turn;
  rays_.anchor(std::move(anchors));
  count_ = static_cast<std::uint32_t>(model.samples.samples.size());
  done_ = 0;
  columns_.emplace(model.samples, heat_);
  bands_.emplace(model.samples, lights);
  exitance_ = {};
  hot_ = {};
  views_ = {};
  faces_.clear();
  bodies_ = BodyNodes(model, geometry_.geometry(), heat_);
  inflow_w_.assign(bodies_.size(), 0.0);
  body_mean_k_.assign(bodies_.size(), 0.0);
  if (!exchange) return;
  exitance_ = EntityExitance(model, geometry_.geometry(), geometry_.entity_of_object());
  hot_ = HotParts(geometry_.geometry(), geometry_.entity_of_object());
  faces_.assign(geometry_.entities(), {});
}

void SurfaceInterval::begin(const SurfaceNode& from, SurfaceNode& to, const SurfaceSamples& all,
                            const WorldInputs& inputs, SurfaceHistory& history) noexcept {
  // Fill the forcing, which also advances the surroundings to the end of the interval.
  history.restore_surroundings(from.surroundings);
  interval_.forcing = history.extend(from.at_ns, to.at_ns, inputs.environment);
  interval_.after_weather = weather_changed(from.at_ns, inputs.environment);
  interval_.entities.update(inputs.parts, inputs.entities, interval_.forcing, from.at_ns, to.at_ns);
  to.forcing = interval_.forcing;
  to.surroundings = history.surroundings();
  to.surroundings_k = history.surroundings_now_k();
  heat_.prepare(interval_);
  // Send the rays with the poses that are known now.
  rays_.update(from.at_ns, to.at_ns, turn_++, inputs.environment, EntityPoses(inputs.entities),
               geometry_.origin_world_m());
  // Sum the radiation of the entities at the begin.
  exitance_.measure(
      all, rays_, [&from](std::size_t sample) { return from.outputs[sample].longwave_out_w_m2; },
      faces_);
  // Advance the interiors of bodies with what their faces pass inwards at the begin.
  const IntervalForcing& forcing = interval_.forcing;
  bodies_.sum_inflow(all, from.states, inflow_w_);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const auto course = bodies_.advance(
        b, from.body_k[b], {inflow_w_[b], heat_.of_bodies().offset_of_k(forcing.begin.air_k)},
        {inflow_w_[b], heat_.of_bodies().offset_of_k(forcing.end.air_k)}, forcing.dt_s);
    to.body_k[b] = course.end_k;
    body_mean_k_[b] = course.mean_k;
  }
  done_ = 0;
  columns_->begin(forcing.dt_s);
  bands_->begin(to, inputs);
}

void SurfaceInterval::compute(const SurfaceNode& from, SurfaceNode& to, double passed_frac,
                              const SurfaceSamples& all, const LocalSteps* skipped,
                              threads::WorkerPool& workers) noexcept {
  const std::size_t units = bands_->units();
  if (!warm()) {
    compute_heat(from, to, passed_frac / (units == 0 ? 1.0 : kHeatFrac), all, skipped, workers);
    return;
  }
  const std::size_t until = due((passed_frac - kHeatFrac) / (1.0 - kHeatFrac), units);
  if (until > bands_->worked()) bands_->work(until, all, rays_, from, to, workers);
}

void SurfaceInterval::compute_heat(const SurfaceNode& from, SurfaceNode& to, double passed_frac,
                                   const SurfaceSamples& all, const LocalSteps* skipped,
                                   threads::WorkerPool& workers) noexcept {
  const bool alone = columns_->columns() == 0;
  advance_samples(
      from, to, static_cast<std::uint32_t>(due(passed_frac / (alone ? 1.0 : kSamplesFrac), count_)),
      all, skipped, workers);
  if (alone || done_ < count_ || columns_->finished()) return;
  // Begin the solution in a frame of its own, and continue at an even rate.
  if (!columns_->started()) {
    columns_->start(from, [&](std::uint32_t sample) {
      return skipped != nullptr && skipped->has_own_clock(sample);
    });
    return;
  }
  const std::size_t until = due((passed_frac - kSamplesFrac) / (kColumnsFrac - kSamplesFrac),
                                ColumnSolve::kMostPasses * columns_->columns());
  if (until > columns_->worked()) columns_->work(until - columns_->worked(), to, workers);
}

void SurfaceInterval::finish(const SurfaceNode& from, SurfaceNode& to, const SurfaceSamples& all,
                             const LocalSteps* skipped, threads::WorkerPool& workers) noexcept {
  if (!warm()) compute_heat(from, to, 1.0, all, skipped, workers);
  if (!warm()) columns_->work(std::numeric_limits<std::size_t>::max(), to, workers);
  bands_->work(bands_->units(), all, rays_, from, to, workers);
}

void SurfaceInterval::advance_samples(const SurfaceNode& from, SurfaceNode& to, std::uint32_t end,
                                      const SurfaceSamples& all, const LocalSteps* skipped,
                                      threads::WorkerPool& workers) noexcept {
  EMIT_CHECK_OP(end, <=, to.states.size());
  const std::uint32_t first = done_;
  if (end <= first) return;
  SurfaceStep step = this->step(all);
  step.columns = &*columns_;
  const auto keep = [&](std::size_t i, const SteppedSample& stepped, const SampleOutput& output) {
    to.states[i] = stepped.state;
    to.outputs[i] = output;
    const std::uint32_t vertex = all.samples[i].vertex;
    if (vertex != kNoSample) {
      to.vertices[vertex] = {output.offset_k, stepped.bow_k, output.sun_frac};
    }
  };
  // Step the samples on all cores.
  workers.run(end - first, kSamplesPerTask, [&](std::size_t task_begin, std::size_t task_end) {
    SteppedSample stepped;
    for (auto i = static_cast<std::uint32_t>(first + task_begin); i < first + task_end; ++i) {
      if (!steps_itself(all, i) || (skipped != nullptr && skipped->has_own_clock(i))) continue;
      stepped.state = from.states[i];
      step_sample(step, rays_, interval_, {from.states, from.outputs}, i, stepped);
      keep(i, stepped, stepped.output);
      const std::uint32_t behind = all.samples[i].other_side;
      if (behind != kNoSample) keep(behind, stepped, stepped.behind);
    }
  });
  done_ = end;
  to.changes.add(std::min(first, to.drawn), std::min(end, to.drawn) - std::min(first, to.drawn));
  // Twins have their values in the order of the samples.
  const auto add_twins = [&](std::uint32_t side_begin, std::uint32_t side_end) {
    const std::uint32_t begin = std::max(first, side_begin);
    const std::uint32_t past = std::min(end, side_end);
    if (begin >= past) return;
    const std::uint32_t place = all.samples[begin].vertex;
    to.changes.add(place, all.samples[past - 1].vertex + 1 - place);
  };
  const auto twins = static_cast<std::uint32_t>(all.twinned.size());
  add_twins(all.first_twin, all.first_twin + twins);
  add_twins(all.first_twin + twins, all.first_twin + 2 * twins);
}

}  // namespace emit::renderer
