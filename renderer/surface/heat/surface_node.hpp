// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emit/renderer/surface_forcing.hpp"
#include "history/ground_state.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Values of a drawn sample, or of a twin of one, at one node of time. The device interpolates them
/// over the surface and between nodes.
struct SampleVertex {
  float offset_k = 0.0F;  ///< temperature from the reference temperature
  /// Temperature in the middle of the interval that ends at the node, from the mean of both ends.
  /// It is 0 where the interval does not follow a sudden change.
  float bow_k = 0.0F;
  float sun_frac = 0.0F;  ///< visible share of the sun's disc
};

/// Shape of a temperature between two nodes, from the line between them, 1 in the middle. `frac` is
/// the place in the interval, 0 to 1. The shape lies between those of a constant curvature and of
/// the square root of time, which ground follows after a sudden change (physics.md eq. 85).
[[nodiscard]] constexpr float bow_shape(float frac) noexcept {
  constexpr float kRise = 0.4F;
  return (2.0F + 4.0F * kRise) * frac * (1.0F - frac) / (frac + kRise);
}
/// Returns the temperature offset of a vertex at a place in the interval, 0 to 1.
[[nodiscard]] constexpr float offset_between_k(const SampleVertex& before,
                                               const SampleVertex& after, float frac) noexcept {
  return before.offset_k + frac * (after.offset_k - before.offset_k) +
         bow_shape(frac) * after.bow_k;
}

/// Record of the parts of a list that have changed, as a bounded number of ranges that together
/// hold them. Everything but the constructor is RT-safe.
class ChangedRanges {
 public:
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  static constexpr std::size_t kMaxRanges = 1024;
  /// Largest gap between two parts that are joined to one range. Sending the gap costs as much as
  /// one more call.
  static constexpr std::uint32_t kGap = 64;

  ChangedRanges() { ranges_.reserve(kMaxRanges); }

  /// Adds a part. Parts in ascending order join best. If all ranges are used, they become one that
  /// covers them all.
  void add(std::uint32_t first, std::uint32_t count) noexcept {
    if (count == 0) return;
    if (!ranges_.empty()) {
      Range& last = ranges_.back();
      if (first >= last.first && first <= last.first + last.count + kGap) {
        last.count = std::max(last.count, first + count - last.first);
        return;
      }
    }
    if (ranges_.size() == kMaxRanges) cover();
    ranges_.push_back({first, count});
  }
  void clear() noexcept { ranges_.clear(); }
  [[nodiscard]] std::span<const Range> ranges() const noexcept { return ranges_; }

 private:
  /// Replaces all ranges by one that covers them.
  void cover() noexcept {
    std::uint32_t low = ranges_.front().first;
    std::uint32_t high = low;
    for (const Range& range : ranges_) {
      low = std::min(low, range.first);
      high = std::max(high, range.first + range.count);
    }
    ranges_.clear();
    ranges_.push_back({low, high - low});
  }

  std::vector<Range> ranges_;
};

/// State of all samples at one node of time: everything that the next interval starts from.
struct SurfaceNode {
  std::uint32_t drawn = 0;  ///< number of drawn samples
  std::vector<SampleState> states;
  std::vector<SampleOutput> outputs;
  /// Values of the drawn samples, for the device. Behind them come those of the low and of the high
  /// twins, if there are any: SurfaceSample::vertex says where a sample has its own.
  std::vector<SampleVertex> vertices;
  ChangedRanges changes;  ///< ranges of `vertices` that have changed
  /// Radiance from other samples, by sample, then band (BandExchange). It is empty without bands.
  std::vector<float> seen_w_m2_sr;
  ChangedRanges seen_changes;  ///< ranges of samples with vertices that have changed there
  std::int64_t at_ns = 0;
  /// Forcing of the interval that ends at this node, as it was assumed when the node was computed.
  IntervalForcing forcing;
  GroundState surroundings;    ///< state of the surroundings
  std::vector<double> body_k;  ///< interiors of the bodies, from the reference temperature
  std::optional<double> surroundings_k;  ///< set if the thermal model computes their temperature
};

/// Interpolates linearly from a (frac = 0) to b (frac = 1), member by member.
template <class T>
[[nodiscard]] T between(T a, T b, double frac) noexcept {
  return a + static_cast<T>(frac) * (b - a);
}
[[nodiscard]] inline physics::FosterState<double> between(const physics::FosterState<double>& a,
                                                          const physics::FosterState<double>& b,
                                                          double frac) noexcept {
  physics::FosterState<double> out;
  for (std::size_t i = 0; i < a.size(); ++i) out[i] = between(a[i], b[i], frac);
  return out;
}
[[nodiscard]] inline GroundState between(const GroundState& a, const GroundState& b,
                                         double frac) noexcept {
  GroundState out;
  out.surroundings = between(a.surroundings, b.surroundings, frac);
  for (WaterGrounds GroundState::*grounds :
       {&GroundState::water, &GroundState::half_water, &GroundState::sheltered}) {
    for (std::size_t s = 0; s < out.water.size(); ++s) {
      const WaterGround& from = (a.*grounds)[s];
      const WaterGround& to = (b.*grounds)[s];
      (out.*grounds)[s] = {between(from.modes_k, to.modes_k, frac),
                           between(from.water_mm, to.water_mm, frac)};
    }
  }
  for (std::size_t g = 0; g < out.watched.size(); ++g) {
    out.watched[g] = between(a.watched[g], b.watched[g], frac);
  }
  out.limits = a.limits;
  return out;
}
[[nodiscard]] inline physics::CellState<float> between(const physics::CellState<float>& a,
                                                       const physics::CellState<float>& b,
                                                       double frac) noexcept {
  physics::CellState<float> out;
  for (std::size_t l = 0; l < a.size(); ++l) out[l] = between(a[l], b[l], frac);
  return out;
}
[[nodiscard]] inline SampleState between(const SampleState& a, const SampleState& b,
                                         double frac) noexcept {
  SampleState out;
  out.modes_k = between(a.modes_k, b.modes_k, frac);
  out.cells_k = between(a.cells_k, b.cells_k, frac);
  out.alone_k = between(a.alone_k, b.alone_k, frac);
  out.aside_k = between(a.aside_k, b.aside_k, frac);
  return out;
}
[[nodiscard]] inline SampleOutput between(const SampleOutput& a, const SampleOutput& b,
                                          double frac) noexcept {
  SampleOutput out;
  for (float SampleOutput::*value :
       {&SampleOutput::offset_k, &SampleOutput::sun_frac, &SampleOutput::longwave_out_w_m2,
        &SampleOutput::shortwave_out_w_m2}) {
    out.*value = between(a.*value, b.*value, frac);
  }
  return out;
}

/// State and output of a sample at one instant.
struct SampleInstant {
  SampleState state;
  SampleOutput output;
};
/// Returns a sample at a place between two nodes, 0 to 1. What the bow of its vertex adds to the
/// temperature is put into the fastest mode, which causes most of it and forgets it first.
[[nodiscard]] inline SampleInstant sample_between(const SurfaceNode& before,
                                                  const SurfaceNode& after, std::uint32_t sample,
                                                  std::uint32_t vertex, double frac) noexcept {
  SampleInstant out{between(before.states[sample], after.states[sample], frac),
                    between(before.outputs[sample], after.outputs[sample], frac)};
  if (vertex == kNoSample) return out;
  const float bow_k = bow_shape(static_cast<float>(frac)) * after.vertices[vertex].bow_k;
  out.state.modes_k[0] += static_cast<double>(bow_k);
  out.output.offset_k += bow_k;
  return out;
}

}  // namespace emit::renderer
