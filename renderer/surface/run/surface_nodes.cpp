// SPDX-License-Identifier: Apache-2.0
#include "surface/run/surface_nodes.hpp"

#include <algorithm>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::renderer {

void SurfaceNodes::begin(std::vector<SampleState> states, std::vector<SampleOutput> outputs,
                         const SurfaceSamples& all, std::uint32_t drawn,
                         std::span<const double> body_k, std::size_t bands) {
  EMIT_CHECK_OP(states.size(), ==, outputs.size());
  ring_ = 0;
  for (SurfaceNode& node : nodes_) {
    node.drawn = drawn;
    node.vertices.assign((all.twinned.empty() ? 1 : 3) * std::size_t{drawn}, {});
    node.seen_w_m2_sr.assign(states.size() * bands, 0.0F);
    node.body_k.assign(body_k.begin(), body_k.end());
  }
  for (std::size_t index : {1U, 2U}) {
    (*this)[index].states.assign(states.size(), {});
    (*this)[index].outputs.assign(outputs.size(), {});
  }
  (*this)[0].states = std::move(states);
  (*this)[0].outputs = std::move(outputs);
}

std::size_t SurfaceNodes::storage(std::size_t index) const noexcept {
  EMIT_DCHECK_OP(index, <, nodes_.size());
  return (ring_ + index) % nodes_.size();
}

const SurfaceNode& SurfaceNodes::stored(std::size_t storage) const noexcept {
  EMIT_DCHECK_OP(storage, <, nodes_.size());
  return nodes_[storage];
}

void SurfaceNodes::rotate() noexcept {
  ring_ = (ring_ + 1) % nodes_.size();
}

void SurfaceNodes::cut(std::int64_t event_ns, std::int64_t end_ns, const LocalSteps& local,
                       const SurfaceSamples& all, threads::WorkerPool& workers) noexcept {
  SurfaceNode& first = (*this)[0];
  SurfaceNode& second = (*this)[1];
  const auto fraction_at = [&](std::int64_t at_ns) {
    return static_cast<double>(at_ns - first.at_ns) /
           static_cast<double>(second.at_ns - first.at_ns);
  };
  // Move states, outputs and vertices of each sample along their course between the nodes, and past
  // its end along the line.
  const double frac = fraction_at(event_ns);
  const double end_frac = fraction_at(end_ns);
  const std::size_t bands =
      first.states.empty() ? 0 : first.seen_w_m2_sr.size() / first.states.size();
  workers.run(first.states.size(), kSamplesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * bands; i < end * bands; ++i) {
      first.seen_w_m2_sr[i] = between(first.seen_w_m2_sr[i], second.seen_w_m2_sr[i], frac);
    }
    for (auto i = static_cast<std::uint32_t>(begin); i < end; ++i) {
      if (frac > 0.0 && !local.has_own_clock(i)) {
        const SampleInstant at = sample_between(first, second, i, all.samples[i].vertex, frac);
        first.states[i] = at.state;
        first.outputs[i] = at.output;
      }
      const std::uint32_t vertex = all.samples[i].vertex;
      if (vertex == kNoSample) continue;
      const SampleVertex from = first.vertices[vertex];
      SampleVertex& to = second.vertices[vertex];
      first.vertices[vertex] = {offset_between_k(from, to, static_cast<float>(frac)), 0.0F,
                                between(from.sun_frac, to.sun_frac, frac)};
      to.offset_k = end_frac < 1.0 ? offset_between_k(from, to, static_cast<float>(end_frac))
                                   : between(from.offset_k, to.offset_k, end_frac);
      to.bow_k = 0.0F;
    }
  });
  first.surroundings = between(first.surroundings, second.surroundings, frac);
  for (std::size_t b = 0; b < first.body_k.size(); ++b) {
    first.body_k[b] = between(first.body_k[b], second.body_k[b], frac);
  }
  if (first.surroundings_k && second.surroundings_k) {
    first.surroundings_k = between(*first.surroundings_k, *second.surroundings_k, frac);
  }
  first.at_ns = event_ns;
  second.at_ns = end_ns;
  for (SurfaceNode* node : {&first, &second}) {
    mark_changed(*node);
  }
}

void SurfaceNodes::mark_changed(SurfaceNode& node) noexcept {
  forget_changes(node);
  node.changes.add(0, static_cast<std::uint32_t>(node.vertices.size()));
  if (!node.seen_w_m2_sr.empty()) node.seen_changes.add(0, node.drawn);
}

void SurfaceNodes::mark_all_changed() noexcept {
  for (SurfaceNode& node : nodes_) mark_changed(node);
}

void SurfaceNodes::forget_changes(SurfaceNode& node) noexcept {
  node.changes.clear();
  node.seen_changes.clear();
}

void SurfaceNodes::forget_changes() noexcept {
  for (SurfaceNode& node : nodes_) forget_changes(node);
}

float SurfaceNodes::fraction(std::int64_t now_ns) const noexcept {
  const std::int64_t begin_ns = (*this)[0].at_ns;
  const double fraction =
      static_cast<double>(now_ns - begin_ns) / static_cast<double>((*this)[1].at_ns - begin_ns);
  return static_cast<float>(std::clamp(fraction, 0.0, 1.0));
}

std::optional<double> SurfaceNodes::surroundings_k(float fraction) const noexcept {
  const SurfaceNode& before = (*this)[0];
  const SurfaceNode& after = (*this)[1];
  if (!before.surroundings_k || !after.surroundings_k) return std::nullopt;
  return between(*before.surroundings_k, *after.surroundings_k, static_cast<double>(fraction));
}

std::uint64_t SurfaceNodes::bytes() const noexcept {
  const auto bytes_of = [](const auto& values) { return values.capacity() * sizeof(values[0]); };
  std::uint64_t sum = 0;
  for (const SurfaceNode& node : nodes_) {
    sum += bytes_of(node.states) + bytes_of(node.outputs) + bytes_of(node.vertices) +
           bytes_of(node.seen_w_m2_sr);
  }
  return sum;
}

}  // namespace emit::renderer
