// SPDX-License-Identifier: Apache-2.0
#include "surface/run/local_steps.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Number of steps in an interval, and limits of the length of a step.
constexpr std::int64_t kStepsPerInterval = 16;
constexpr std::int64_t kMinStepNs = 250'000'000;
constexpr std::int64_t kMaxStepNs = 1'250'000'000;
/// Distance and turn from the foreseen pose within which an entity's shade counts as foreseen.
constexpr double kForeseenM = 0.05;
constexpr double kForeseenRad = 5e-3;
/// Turn within an interval from which an entity's own samples take steps of their own, because an
/// interval knows one attitude. Up to it, direct sunlight on a face is off by a tenth of that on a
/// face towards the sun at most.
constexpr double kTurnedRad = 0.1;
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();

/// Place of an instant between two nodes: 0 at `before`, 1 at `after`.
double way_of(std::int64_t at_ns, const SurfaceNode& before, const SurfaceNode& after) noexcept {
  return static_cast<double>(at_ns - before.at_ns) /
         static_cast<double>(after.at_ns - before.at_ns);
}

/// Blocks that hold samples of a part.
std::vector<std::uint32_t> blocks_of(const PartHistory& part, const SampleBlocks& blocks,
                                     const SurfaceSamples& all) {
  std::vector<std::uint32_t> out;
  for (std::uint32_t b = 0; b < blocks.blocks().size(); ++b) {
    if (blocks.blocks()[b].entity != static_cast<std::int32_t>(part.entity())) continue;
    const auto is_of_part = [&](std::uint32_t i) {
      return all.samples[i].material == part.material();
    };
    if (std::ranges::any_of(blocks.samples(b), is_of_part)) out.push_back(b);
  }
  return out;
}

/// Number of commands of all parts so far.
std::uint64_t revision_of(std::span<const PartHistory> parts) noexcept {
  std::uint64_t sum = 0;
  for (const PartHistory& part : parts) sum += part.revision();
  return sum;
}

/// Sets the values of a vertex at both nodes so that the line between them passes through
/// `offset_k` at `at_ns` and through `end` at `end_ns`.
void draw_line(std::uint32_t vertex, std::int64_t at_ns, float offset_k, std::int64_t end_ns,
               const SampleOutput& end, const LocalSteps::Window& window) noexcept {
  if (vertex == kNoSample) return;
  const double slope_k_ns = (static_cast<double>(end.offset_k) - static_cast<double>(offset_k)) /
                            static_cast<double>(end_ns - at_ns);
  const auto at_node = [&](const SurfaceNode& node) {
    return SampleVertex{static_cast<float>(static_cast<double>(offset_k) +
                                           slope_k_ns * static_cast<double>(node.at_ns - at_ns)),
                        0.0F, end.sun_frac};
  };
  window.before.vertices[vertex] = at_node(window.before);
  window.after.vertices[vertex] = at_node(window.after);
  window.before.changes.add(vertex, 1);
  window.after.changes.add(vertex, 1);
}

}  // namespace

LocalSteps::LocalSteps(const SurfaceSamples& all, const Setup& setup, const IntervalRays& rays,
                       HeatInterval interval)
    : blocks_(all),
      start_ns_(setup.start_ns),
      step_ns_(std::clamp(setup.interval_ns / kStepsPerInterval, kMinStepNs, kMaxStepNs)),
      turn_ns_(step_ns_ / static_cast<std::int64_t>(kTurns)),
      rays_(rays),
      known_rays_(rays),
      interval_(std::move(interval)),
      state_(blocks_.blocks().size(), State::of_interval),
      at_ns_(blocks_.blocks().size(), kNever),
      touched_ns_(blocks_.blocks().size(), kNever),
      foreseen_ns_(blocks_.blocks().size(), kNever),
      known_found_(setup.entities, 0),
      own_clock_(all.samples.size(), 0) {
  rays_.take_short();
  interval_.entities.airs.resize(setup.entities);
  for (const PartHistory& part : setup.parts) {
    part_blocks_.push_back(blocks_of(part, blocks_, all));
  }
  entity_blocks_.resize(setup.entities);
  for (std::uint32_t b = 0; b < blocks_.blocks().size(); ++b) {
    const std::int32_t entity = blocks_.blocks()[b].entity;
    if (entity >= 0) entity_blocks_[static_cast<std::size_t>(entity)].push_back(b);
  }
  for (auto& known : known_) known.resize(setup.entities);
  for (auto& entities : foreseen_) entities.resize(setup.entities);
  for (auto& turn : turns_) turn.reserve(state_.size() / kTurns + 1);
  chosen_.reserve(state_.size() / kTurns + 1);
  batch_.reserve(kBatch);
  stepped_.resize(kBatch);
}

void LocalSteps::send_rays(std::size_t interval, std::span<const PoseHistory> entities) noexcept {
  for (std::size_t m = 0; m < entities.size(); ++m) known_[interval][m] = entities[m].known();
}

void LocalSteps::restart(std::int64_t now_ns) noexcept {
  for (auto& turn : turns_) turn.clear();
  std::ranges::fill(state_, State::of_interval);
  std::ranges::fill(at_ns_, kNever);
  std::ranges::fill(touched_ns_, kNever);
  std::ranges::fill(foreseen_ns_, kNever);
  std::ranges::fill(own_clock_, std::uint8_t{0});
  std::ranges::fill(known_found_, std::uint8_t{0});
  next_turn_ = std::max<std::int64_t>(0, now_ns - start_ns_) / turn_ns_ + 1;
}

std::size_t LocalSteps::active() const noexcept {
  std::size_t sum = 0;
  for (const auto& turn : turns_) sum += turn.size();
  return sum;
}

void LocalSteps::run(std::int64_t until_ns, const Window& window, const Inputs& inputs) noexcept {
  EMIT_CHECK_OP(until_ns, <=, window.after.at_ns);
  for (;; ++next_turn_) {
    const std::int64_t at_ns = start_ns_ + next_turn_ * turn_ns_;
    if (at_ns > until_ns) return;
    look_around(at_ns, window, inputs);
    take_turn(static_cast<std::size_t>(next_turn_) % kTurns, at_ns, window, inputs);
  }
}

void LocalSteps::look_around(std::int64_t at_ns, const Window& window,
                             const Inputs& inputs) noexcept {
  // Find the blocks near entities that have departed, as they go on from now.
  const auto departs = [&](std::size_t m) {
    return inputs.entities[m].departs(known_[0][m], at_ns);
  };
  bool ready = false;
  for (std::size_t m = 0; m < inputs.entities.size(); ++m) {
    if (!departs(m)) continue;
    if (!std::exchange(ready, true)) {
      // Look a step ahead, so that blocks are on their own before the entity arrives.
      rays_.update(at_ns - turn_ns_, at_ns + step_ns_, 0, inputs.environment,
                   EntityPoses::ahead(inputs.entities), inputs.origin_world_m);
    }
    want(m, rays_, at_ns);
  }
  // Find once per interval the blocks that were to be shaded by such entities.
  ready = false;
  for (std::size_t m = 0; m < inputs.entities.size(); ++m) {
    if (known_found_[m] != 0 || !departs(m)) continue;
    known_found_[m] = 1;
    if (!std::exchange(ready, true)) {
      known_rays_.update(at_ns - turn_ns_, window.after.at_ns, 0, inputs.environment,
                         EntityPoses::as_known(inputs.entities, known_[0]), inputs.origin_world_m);
    }
    want(m, known_rays_, at_ns);
  }
  // Find the entities that turn within the interval, by the script too.
  for (std::size_t m = 0; m < inputs.entities.size(); ++m) {
    if (entity_blocks_[m].empty()) continue;
    const PoseHistory& entity = inputs.entities[m];
    const TrajectoryState now = entity.at(at_ns);
    const auto turned = [&](std::int64_t other_ns) {
      constexpr double kAnywhereM = std::numeric_limits<double>::infinity();
      return !physics::close(now.pose, entity.at(other_ns).pose, kAnywhereM, kTurnedRad);
    };
    if (!now.on || !(turned(window.before.at_ns) || turned(at_ns - step_ns_) ||
                     turned(at_ns + step_ns_) || turned(window.after.at_ns))) {
      continue;
    }
    for (const std::uint32_t b : entity_blocks_[m]) want_block(b, at_ns);
  }
  // Find the parts whose heat changes now or within the step ahead.
  for (std::size_t p = 0; p < part_blocks_.size(); ++p) {
    if (!inputs.parts[p].changes(at_ns - step_ns_, at_ns + step_ns_)) continue;
    for (const std::uint32_t b : part_blocks_[p]) want_block(b, at_ns);
  }
}

void LocalSteps::want_block(std::uint32_t block, std::int64_t at_ns) noexcept {
  // Mark the block as touched, and put it in its group unless it is there already.
  touched_ns_[block] = at_ns;
  if (state_[block] != State::of_interval) return;
  state_[block] = State::wanted;
  turns_[block % kTurns].push_back(block);
}

void LocalSteps::want(std::size_t entity, const IntervalRays& rays, std::int64_t at_ns) noexcept {
  for (std::uint32_t b = 0; b < state_.size(); ++b) {
    const SampleBlocks::Block& block = blocks_.blocks()[b];
    if (block.entity != static_cast<std::int32_t>(entity) &&
        !rays.touches(entity, block.centre_m, block.radius_m, block.entity)) {
      continue;
    }
    want_block(b, at_ns);
  }
}

void LocalSteps::take_turn(std::size_t turn, std::int64_t at_ns, const Window& window,
                           const Inputs& inputs) noexcept {
  std::vector<std::uint32_t>& blocks = turns_[turn];
  if (blocks.empty()) return;
  // Make up for the time that has passed.
  bring(blocks, at_ns, window, inputs);
  // Return blocks that nothing touched in this interval, but not right before the interval ends.
  const bool may_leave = window.after.at_ns - at_ns > turn_ns_;
  const auto leaving = std::partition(blocks.begin(), blocks.end(), [&](std::uint32_t b) {
    return !may_leave || touched_ns_[b] >= window.before.at_ns;
  });
  const auto stay = static_cast<std::size_t>(leaving - blocks.begin());
  show(std::span(blocks).first(stay), turn, at_ns, window, inputs);
  hand_back(std::span(blocks).subspan(stay), at_ns, window, inputs);
  blocks.resize(stay);
  // Leave the surroundings at node `next`, to which the forcing of its interval had brought them.
  inputs.history.restore_surroundings(window.next.surroundings);
}

void LocalSteps::take_weather_change(std::int64_t event_ns, const Window& window,
                                     const SurfaceSamples& all) noexcept {
  EMIT_CHECK_OP(event_ns, >=, window.before.at_ns);
  EMIT_CHECK_OP(event_ns, <=, window.after.at_ns);
  for (std::uint32_t b = 0; b < state_.size(); ++b) {
    // Put blocks that came back in this interval on their own again: they do not lie on the line
    // between the nodes, so the moved node would hold wrong values of them.
    const bool came_back = state_[b] == State::of_interval && at_ns_[b] > window.before.at_ns;
    if (came_back) turns_[b % kTurns].push_back(b);
    if (came_back || state_[b] == State::wanted) begin_alone(b, event_ns, window, all);
  }
}

void LocalSteps::discard_foreseen(std::int64_t event_ns) noexcept {
  for (std::int64_t& foreseen_ns : foreseen_ns_) {
    if (foreseen_ns > event_ns) foreseen_ns = kNever;
  }
}

template <class Visit>
void LocalSteps::each_sample(std::uint32_t block, const SurfaceSamples& all,
                             const Visit& visit) noexcept {
  for (const std::uint32_t i : blocks_.samples(block)) {
    visit(i);
    if (all.samples[i].other_side != kNoSample) visit(all.samples[i].other_side);
  }
}

void LocalSteps::begin_alone(std::uint32_t block, std::int64_t at_ns, const Window& window,
                             const SurfaceSamples& all) noexcept {
  // Begin where the block last came back: node `before` holds it at that instant.
  const std::int64_t from_ns = std::max(at_ns_[block], window.before.at_ns);
  state_[block] = State::on_its_own;
  at_ns_[block] = window.renewing ? from_ns : std::max(at_ns, from_ns);
  const double frac = static_cast<double>(at_ns_[block] - from_ns) /
                      static_cast<double>(window.after.at_ns - from_ns);
  // Interpolate its states along the interval.
  each_sample(block, all, [&](std::uint32_t i) {
    own_clock_[i] = 1;
    const SampleInstant at =
        sample_between(window.before, window.after, i, all.samples[i].vertex, frac);
    window.before.states[i] = at.state;
    window.before.outputs[i] = at.output;
    // Keep the solution of a renewal from this sample: it began without a clock of its own.
    const std::uint32_t column = all.samples[i].column;
    if (window.renewing && column != kNoSample) window.stepped_again[column] = 1;
  });
}

void LocalSteps::prepare(std::int64_t begin_ns, std::int64_t end_ns, const Window& window,
                         const Inputs& inputs) noexcept {
  // Interpolate the surroundings between the nodes, and advance them over the step.
  inputs.history.restore_surroundings(between(window.before.surroundings, window.after.surroundings,
                                              way_of(begin_ns, window.before, window.after)));
  interval_.forcing = inputs.history.extend(begin_ns, end_ns, inputs.environment);
  interval_.entities.update(inputs.parts, inputs.entities, interval_.forcing, begin_ns, end_ns);
  inputs.step.heat.prepare(interval_);
  rays_.update(begin_ns, end_ns, static_cast<std::uint32_t>(end_ns / step_ns_), inputs.environment,
               EntityPoses::ahead(inputs.entities), inputs.origin_world_m);
}

template <class Keep>
void LocalSteps::step(std::span<const std::uint32_t> blocks, std::uint32_t end,
                      const SurfaceNode& from, const IntervalRays& rays,
                      const HeatInterval& interval, const Inputs& inputs,
                      const Keep& keep) noexcept {
  // Step a batch on all cores before anything is written, because samples read each other's
  // outputs.
  const auto flush = [&] {
    inputs.workers.run(batch_.size(), kSamplesPerTask, [&](std::size_t begin, std::size_t stop) {
      for (std::size_t k = begin; k < stop; ++k) {
        stepped_[k].state = from.states[batch_[k]];
        step_sample(inputs.step, rays, interval, {from.states, from.outputs}, batch_[k],
                    stepped_[k]);
      }
    });
    for (std::size_t k = 0; k < batch_.size(); ++k) {
      const std::uint32_t behind = inputs.step.all.samples[batch_[k]].other_side;
      keep(batch_[k], stepped_[k], stepped_[k].output);
      if (behind != kNoSample) keep(behind, stepped_[k], stepped_[k].behind);
    }
    batch_.clear();
  };
  // Fill batches block by block.
  for (const std::uint32_t block : blocks) {
    const auto samples = blocks_.samples(block);
    if (batch_.size() + samples.size() > kBatch) flush();
    for (const std::uint32_t i : samples) {
      if (i < end) batch_.push_back(i);
    }
  }
  flush();
}

void LocalSteps::bring(std::span<const std::uint32_t> blocks, std::int64_t to_ns,
                       const Window& window, const Inputs& inputs) noexcept {
  // Take blocks that are new to the group out of the interval, one step ago.
  for (const std::uint32_t b : blocks) {
    if (state_[b] == State::wanted) begin_alone(b, to_ns - step_ns_, window, inputs.step.all);
  }
  // Adopt the step ahead if the poses came as foreseen.
  const bool as_foreseen =
      came_true(static_cast<std::size_t>(blocks.front()) % kTurns, to_ns, inputs);
  for (const std::uint32_t b : blocks) {
    if (!as_foreseen || foreseen_ns_[b] != to_ns) continue;
    each_sample(b, inputs.step.all, [&](std::uint32_t i) {
      window.before.states[i] = window.after.states[i];
      window.before.outputs[i] = window.after.outputs[i];
    });
    at_ns_[b] = to_ns;
  }
  // Step the others in sets that begin at the same instant. Nearly all of them form one set.
  for (std::int64_t from_ns = kNever;;) {
    std::int64_t earliest_ns = to_ns;
    for (const std::uint32_t b : blocks) {
      if (at_ns_[b] > from_ns) earliest_ns = std::min(earliest_ns, at_ns_[b]);
    }
    if (earliest_ns == to_ns) return;
    from_ns = earliest_ns;
    chosen_.clear();
    for (const std::uint32_t b : blocks) {
      if (at_ns_[b] == from_ns) chosen_.push_back(b);
    }
    prepare(from_ns, to_ns, window, inputs);
    step(chosen_, std::numeric_limits<std::uint32_t>::max(), window.before, rays_, interval_,
         inputs, [&](std::uint32_t i, const SteppedSample& stepped, const SampleOutput& output) {
           window.before.states[i] = stepped.state;
           window.before.outputs[i] = output;
         });
    for (const std::uint32_t b : chosen_) at_ns_[b] = to_ns;
  }
}

void LocalSteps::show(std::span<const std::uint32_t> blocks, std::size_t turn, std::int64_t at_ns,
                      const Window& window, const Inputs& inputs) noexcept {
  if (blocks.empty()) return;
  const std::int64_t end_ns = at_ns + step_ns_;
  prepare(at_ns, end_ns, window, inputs);
  step(blocks, std::numeric_limits<std::uint32_t>::max(), window.before, rays_, interval_, inputs,
       [&](std::uint32_t i, const SteppedSample& stepped, const SampleOutput& output) {
         draw_line(inputs.step.all.samples[i].vertex, at_ns, window.before.outputs[i].offset_k,
                   end_ns, output, window);
         window.after.states[i] = stepped.state;
         window.after.outputs[i] = output;
       });
  // Note the poses that the step ahead was made with.
  for (const std::uint32_t b : blocks) foreseen_ns_[b] = end_ns;
  for (std::size_t m = 0; m < foreseen_[turn].size(); ++m) {
    foreseen_[turn][m] = inputs.entities[m].ahead(end_ns);
  }
  foreseen_parts_[turn] = revision_of(inputs.parts);
}

bool LocalSteps::came_true(std::size_t turn, std::int64_t at_ns,
                           const Inputs& inputs) const noexcept {
  if (foreseen_parts_[turn] != revision_of(inputs.parts)) return false;
  for (std::size_t m = 0; m < foreseen_[turn].size(); ++m) {
    const TrajectoryState now = inputs.entities[m].at(at_ns);
    const TrajectoryState& then = foreseen_[turn][m];
    if (now.on != then.on ||
        (now.on && !physics::close(now.pose, then.pose, kForeseenM, kForeseenRad))) {
      return false;
    }
  }
  return true;
}

void LocalSteps::hand_back(std::span<const std::uint32_t> blocks, std::int64_t at_ns,
                           const Window& window, const Inputs& inputs) noexcept {
  if (blocks.empty()) return;
  // Advance the blocks over the rest of the interval.
  prepare(at_ns, window.after.at_ns, window, inputs);
  step(blocks, std::numeric_limits<std::uint32_t>::max(), window.before, rays_, interval_, inputs,
       [&](std::uint32_t i, const SteppedSample& stepped, const SampleOutput& output) {
         draw_line(inputs.step.all.samples[i].vertex, at_ns, window.before.outputs[i].offset_k,
                   window.after.at_ns, output, window);
         window.after.states[i] = stepped.state;
         window.after.outputs[i] = output;
       });
  // Repeat the part of the next interval that is computed already: it began without these states.
  step(blocks, window.done, window.after, window.next_rays, window.next_interval, inputs,
       [&](std::uint32_t i, const SteppedSample& stepped, const SampleOutput& output) {
         window.next.states[i] = stepped.state;
         window.next.outputs[i] = output;
         const std::uint32_t column = inputs.step.all.samples[i].column;
         if (column != kNoSample) window.stepped_again[column] = 1;
         const std::uint32_t vertex = inputs.step.all.samples[i].vertex;
         if (vertex == kNoSample) return;
         window.next.vertices[vertex] = {output.offset_k, stepped.bow_k, output.sun_frac};
         window.next.changes.add(vertex, 1);
       });
  for (const std::uint32_t b : blocks) {
    state_[b] = State::of_interval;
    foreseen_ns_[b] = kNever;
  }
}

void LocalSteps::rotate(const Window& window, const SurfaceSamples& all) noexcept {
  EMIT_CHECK_OP(start_ns_ + next_turn_ * turn_ns_, >, window.after.at_ns);
  // Take wanted blocks out now, while the instant at which they begin lies between the two nodes.
  for (const auto& turn : turns_) {
    for (const std::uint32_t b : turn) {
      if (state_[b] == State::wanted) begin_alone(b, window.after.at_ns - step_ns_, window, all);
    }
  }
}

void LocalSteps::rotated(const Window& window, const SurfaceSamples& all) noexcept {
  // Make the poses of the next interval those of the current one.
  std::swap(known_[0], known_[1]);
  std::ranges::fill(known_found_, std::uint8_t{0});
  const SurfaceNode& old = window.next;  // the node before the current interval
  const auto ways =
      static_cast<float>(static_cast<double>(window.after.at_ns - window.before.at_ns) /
                         static_cast<double>(window.before.at_ns - old.at_ns));
  // Let blocks that came back follow the clock of the nodes again.
  for (std::uint32_t b = 0; b < state_.size(); ++b) {
    if (state_[b] != State::of_interval || at_ns_[b] < old.at_ns) continue;
    each_sample(b, all, [&](std::uint32_t i) { own_clock_[i] = 0; });
  }
  // Move blocks on their own back by one node, and extend their line to the new end.
  for (const auto& turn : turns_) {
    for (const std::uint32_t block : turn) {
      each_sample(block, all, [&](std::uint32_t i) {
        window.after.states[i] = window.before.states[i];
        window.after.outputs[i] = window.before.outputs[i];
        window.before.states[i] = old.states[i];
        window.before.outputs[i] = old.outputs[i];
        const std::uint32_t vertex = all.samples[i].vertex;
        if (vertex == kNoSample) return;
        const SampleVertex& now = window.before.vertices[vertex];
        const float way_k = now.offset_k - old.vertices[vertex].offset_k;
        window.after.vertices[vertex] = {now.offset_k + ways * way_k, 0.0F, now.sun_frac};
        window.after.changes.add(vertex, 1);
      });
    }
  }
}

}  // namespace emit::renderer
