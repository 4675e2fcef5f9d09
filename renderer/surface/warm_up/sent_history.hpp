// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>

#include "emit/physics/check.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/warm_up/row_store.hpp"

namespace emit::renderer {

/// Radiation that one sample sends out over the whole history: a view of a row of float32 numbers.
/// The row holds the long-wave exitance at every node and the reflected sunlight of every interval,
/// all in W/m2. An interval lies between two nodes. A view of an empty row keeps nothing.
class SentRow {
 public:
  SentRow() = default;
  explicit SentRow(std::span<float> values) noexcept
      : values_(values.data()), intervals_(values.empty() ? 0 : (values.size() - 1) / 2) {}

  /// Returns the number of values in the row of a history of `intervals` intervals.
  [[nodiscard]] static constexpr std::size_t length(std::size_t intervals) noexcept {
    return 2 * intervals + 1;
  }

  /// Stores the output at the first node. @pre the row is not empty
  void keep_begin(const SampleOutput& output) const noexcept { keep_node(0, output); }
  /// Stores the output over `interval` and at the node where it ends. @pre the row is not empty
  void keep_end(std::size_t interval, const SampleOutput& output) const noexcept {
    EMIT_DCHECK_OP(interval, <, intervals_);
    keep_node(interval + 1, output);
    values_[intervals_ + 1 + interval] = output.shortwave_out_w_m2;
  }

  [[nodiscard]] float longwave_w_m2(std::size_t node) const noexcept { return values_[node]; }
  [[nodiscard]] float shortwave_w_m2(std::size_t interval) const noexcept {
    return values_[intervals_ + 1 + interval];
  }
  void keep_longwave(std::size_t node, float w_m2) const noexcept { values_[node] = w_m2; }
  void keep_shortwave(std::size_t interval, float w_m2) const noexcept {
    values_[intervals_ + 1 + interval] = w_m2;
  }

 private:
  void keep_node(std::size_t node, const SampleOutput& output) const noexcept {
    EMIT_DCHECK(values_ != nullptr);
    EMIT_DCHECK_OP(node, <=, intervals_);
    values_[node] = output.longwave_out_w_m2;
  }

  float* values_ = nullptr;
  std::size_t intervals_ = 0;
};

/// Rows of the samples of a patch.
using SentHistory = RowStore<float>;

}  // namespace emit::renderer
