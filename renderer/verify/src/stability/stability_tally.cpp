// SPDX-License-Identifier: Apache-2.0
#include "stability_tally.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace emit::verify {
namespace {

constexpr unsigned kClassShift = 20;  // keeps 8 exponent bits and 3 bits of the mantissa

}  // namespace

bool Tally::count_finite(float result) noexcept {
  ++cases_;
  if (std::isnan(result)) {
    ++nan_;
    return false;
  }
  if (std::isinf(result)) {
    ++inf_;
    return false;
  }
  below_zero_ += result < 0.0F ? 1U : 0U;
  return true;
}

void Tally::add_unknown(float result) noexcept {
  static_cast<void>(count_finite(result));
}

void Tally::add(float result, double truth, double error_k, double error_frac,
                std::uint32_t index) noexcept {
  if (!count_finite(result)) return;
  if (!std::isfinite(truth)) return;
  ++known_;
  if (error_frac > max_frac_) {
    max_frac_ = error_frac;
    worst_frac_ = index;
  }
  if (!std::isfinite(error_k)) return;  // the row then states relative errors alone
  ++known_k_;
  over_1mk_ += error_k > 1e-3 ? 1U : 0U;
  if (error_k > max_error_k_) {
    max_error_k_ = error_k;
    worst_k_ = index;
  }
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(error_k));
  ++histogram_[std::min<std::size_t>(bits >> kClassShift, histogram_.size() - 1)];
}

void Tally::merge(const Tally& other) noexcept {
  cases_ += other.cases_;
  nan_ += other.nan_;
  inf_ += other.inf_;
  below_zero_ += other.below_zero_;
  clamped_ += other.clamped_;
  unflagged_ += other.unflagged_;
  known_ += other.known_;
  known_k_ += other.known_k_;
  over_1mk_ += other.over_1mk_;
  // The lower case number wins between equal errors, so that the row does not depend on the number
  // of threads.
  const auto larger = [](double error, std::uint32_t index, double& worst, std::uint32_t& at) {
    if (error > worst || (error == worst && index < at)) {
      worst = error;
      at = index;
    }
  };
  larger(other.max_error_k_, other.worst_k_, max_error_k_, worst_k_);
  larger(other.max_frac_, other.worst_frac_, max_frac_, worst_frac_);
  for (std::size_t i = 0; i < histogram_.size(); ++i) histogram_[i] += other.histogram_[i];
}

void Tally::write(SweepResult& row) const {
  row.cases = cases_;
  row.nan_count = nan_;
  row.inf_count = inf_;
  row.clamped_count = clamped_;
  row.unflagged_count = unflagged_;
  row.below_zero_count = below_zero_;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  row.max_error_k = known_k_ > 0 ? max_error_k_ : kNone;
  row.max_error_frac = known_ > 0 ? max_frac_ : kNone;
  row.over_1mk_frac =
      known_k_ > 0 ? static_cast<double>(over_1mk_) / static_cast<double>(known_k_) : kNone;
  row.p99_error_k = kNone;
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < histogram_.size() && known_k_ > 0; ++i) {
    below += histogram_[i];
    if (static_cast<double>(below) < 0.99 * static_cast<double>(known_k_)) continue;
    // Use the upper end of the class, which is never better than the true percentile.
    const auto end = static_cast<std::uint32_t>(i + 1) << kClassShift;
    row.p99_error_k =
        i == 0 ? 0.0 : std::min(static_cast<double>(std::bit_cast<float>(end)), max_error_k_);
    break;
  }
}

}  // namespace emit::verify
