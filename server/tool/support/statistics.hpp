// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace emit::tool {

/// Samples of one quantity; percentiles by nearest rank on the sorted samples. Setup only.
class Samples {
 public:
  Samples() = default;
  /// Keeps at most `most` samples, evenly spread over all. When there is no room, every second one
  /// is dropped. Number, sum and maximum stay exact. The memory is taken at once.
  /// @pre most is even and not 0
  explicit Samples(std::size_t most);

  void add(double value);
  void reserve(std::size_t count) { values_.reserve(count); }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] bool empty() const noexcept { return values_.empty(); }
  /// Returns the smallest sample that at least the share `frac` in [0, 1] does not exceed; NaN when
  /// empty.
  [[nodiscard]] double percentile(double frac) const;
  [[nodiscard]] double median() const;  ///< mean of the two middle samples for an even count
  [[nodiscard]] double mean() const;
  [[nodiscard]] double max() const;
  [[nodiscard]] double sum() const;
  /// Returns the samples kept, in the order in which they came.
  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }

 private:
  std::vector<double> values_;
  std::size_t most_ = 0;    // 0: no limit
  std::size_t stride_ = 1;  // one of so many is kept
  std::size_t count_ = 0;
  double sum_ = 0.0;
  double max_ = 0.0;
};

/// Returns a histogram as text with logarithmic bins of the 1-2-5 series; `unit` follows the bin
/// limits.
[[nodiscard]] std::string histogram_text(const Samples& samples, const std::string& unit);

}  // namespace emit::tool
