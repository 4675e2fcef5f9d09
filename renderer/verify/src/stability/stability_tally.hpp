// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>

#include "emit/verify/stability.hpp"

namespace emit::verify {

/// Counters and errors of one row of the result table. Each thread has its own; they are merged at
/// the end.
class Tally {
 public:
  /// Adds a result with its truth. NaN and infinity are counted and do not contribute to the
  /// errors. An error in kelvin that is not finite contributes its relative error alone.
  void add(float result, double truth, double error_k, double error_frac,
           std::uint32_t index) noexcept;
  /// Adds a result without a known truth. Only its finiteness is counted.
  void add_unknown(float result) noexcept;
  /// Adds the clamped flag of a case; `valid` tells whether the input is in the valid range.
  void add_flag(bool clamped, bool valid) noexcept {
    clamped_ += clamped ? 1U : 0U;
    unflagged_ += !clamped && !valid ? 1U : 0U;
  }
  /// Adds the counters and errors of another tally.
  void merge(const Tally& other) noexcept;

  /// Writes the counters and errors to a row.
  void write(SweepResult& row) const;
  /// Returns the case with the largest error in kelvin (else the largest relative one).
  [[nodiscard]] std::uint32_t worst_case() const noexcept {
    return max_error_k_ > 0.0 ? worst_k_ : worst_frac_;
  }
  [[nodiscard]] bool has_worst() const noexcept { return max_error_k_ > 0.0 || max_frac_ > 0.0; }

 private:
  [[nodiscard]] bool count_finite(float result) noexcept;

  std::uint64_t cases_ = 0;
  std::uint64_t nan_ = 0;
  std::uint64_t inf_ = 0;
  std::uint64_t below_zero_ = 0;
  std::uint64_t clamped_ = 0;
  std::uint64_t unflagged_ = 0;
  std::uint64_t known_ = 0;    ///< number of finite results with a truth
  std::uint64_t known_k_ = 0;  ///< number of these whose error in kelvin is known
  std::uint64_t over_1mk_ = 0;
  double max_error_k_ = 0.0;
  double max_frac_ = 0.0;
  std::uint32_t worst_k_ = 0;
  std::uint32_t worst_frac_ = 0;
  /// Histogram of the errors by the leading bits of their float32 form: 8 classes per factor of
  /// two.
  std::array<std::uint64_t, 2048> histogram_{};
};

}  // namespace emit::verify
