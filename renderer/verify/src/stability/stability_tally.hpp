// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>

#include "emit/verify/stability.hpp"

namespace emit::verify {

/// Counts and errors of one row while it grows. One per thread, merged at the end.
class Tally {
 public:
  /// A result against its truth; NaN and Inf are counted and take no part in the errors. An error
  /// in kelvin that is not finite leaves the row with relative errors.
  void add(float result, double truth, double error_k, double error_frac,
           std::uint32_t index) noexcept;
  /// A result of which no truth is known: finite or not is all there is to say.
  void add_unknown(float result) noexcept;
  void add_flag(bool clamped, bool valid) noexcept {
    clamped_ += clamped ? 1U : 0U;
    unflagged_ += !clamped && !valid ? 1U : 0U;
  }
  void merge(const Tally& other) noexcept;

  /// Fills the counts and errors of a row; `cases` is how many were added.
  void write(SweepResult& row) const;
  /// Case where the largest error in kelvin (else the largest relative one) was met.
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
  std::uint64_t known_ = 0;    ///< finite results with a truth
  std::uint64_t known_k_ = 0;  ///< ... of which the error is known in kelvin
  std::uint64_t over_1mk_ = 0;
  double max_error_k_ = 0.0;
  double max_frac_ = 0.0;
  std::uint32_t worst_k_ = 0;
  std::uint32_t worst_frac_ = 0;
  /// Errors by the leading bits of their float32 form: 8 classes per factor of two.
  std::array<std::uint64_t, 2048> histogram_{};
};

}  // namespace emit::verify
