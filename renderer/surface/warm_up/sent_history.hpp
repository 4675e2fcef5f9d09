// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Radiation and heat that samples send out over the whole history, one row of float32 numbers per
/// sample. A row holds the long-wave exitance at every node, the reflected sunlight of every
/// interval and the net flux into the solid at every node, all in W/m2. An interval lies between
/// two nodes.
/// Threads may write different rows at the same time.
class SentHistory {
 public:
  SentHistory() = default;
  /// Begins with no samples. `intervals` may be 0: then rows are empty and nothing is stored.
  explicit SentHistory(std::size_t intervals)
      : intervals_(intervals), row_(intervals == 0 ? 0 : 3 * intervals + 2) {}

  void resize(std::size_t samples) { values_.resize(samples * row_); }
  [[nodiscard]] bool keeps() const noexcept { return row_ != 0; }
  [[nodiscard]] std::size_t intervals() const noexcept { return intervals_; }

  /// Stores the output of a sample at the first node. @pre keeps()
  void keep_begin(std::size_t sample, const SampleOutput& output) noexcept {
    keep_node(sample, 0, output);
  }
  /// Stores the output of a sample over `interval` and at the node where it ends. @pre keeps()
  void keep_end(std::size_t sample, std::size_t interval, const SampleOutput& output) noexcept {
    keep_node(sample, interval + 1, output);
    at(sample, intervals_ + 1 + interval) = output.shortwave_out_w_m2;
  }

  /// Part of a row that other samples receive: the long wave at all nodes, then the sunlight of all
  /// intervals.
  [[nodiscard]] std::span<const float> radiation_w_m2(std::size_t sample) const noexcept {
    return std::span(values_).subspan(sample * row_, radiation_size());
  }
  [[nodiscard]] std::size_t radiation_size() const noexcept { return 2 * intervals_ + 1; }
  [[nodiscard]] float longwave_w_m2(std::size_t sample, std::size_t node) const noexcept {
    return values_[sample * row_ + node];
  }
  [[nodiscard]] float flux_w_m2(std::size_t sample, std::size_t node) const noexcept {
    return values_[sample * row_ + 2 * intervals_ + 1 + node];
  }
  [[nodiscard]] std::span<const float> row(std::size_t sample) const noexcept {
    return std::span(values_).subspan(sample * row_, row_);
  }
  [[nodiscard]] std::span<float> row(std::size_t sample) noexcept {
    return std::span(values_).subspan(sample * row_, row_);
  }
  /// Frees the memory.
  void clear() noexcept { values_ = {}; }

 private:
  [[nodiscard]] float& at(std::size_t sample, std::size_t place) noexcept {
    EMIT_DCHECK_OP(place, <, row_);
    return values_[sample * row_ + place];
  }
  void keep_node(std::size_t sample, std::size_t node, const SampleOutput& output) noexcept {
    at(sample, node) = output.longwave_out_w_m2;
    at(sample, 2 * intervals_ + 1 + node) = output.flux_w_m2;
  }

  std::size_t intervals_ = 0;
  std::size_t row_ = 0;
  std::vector<float> values_;
};

}  // namespace emit::renderer
