// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <cstdlib>
#include <optional>

#include "rt/clock.hpp"

namespace emit::server {

/// Detects that somebody sets the wall clock. Pacing corrects itself (IgClock), but the cause of
/// late or repeated frames should be known. Thread: one owner.
class ClockWatch {
 public:
  explicit ClockWatch(const Clock& clock) noexcept : clock_(clock) {}

  /// Returns by how much the wall clock was set since the last call, ns. 0 means by less than 1 ms,
  /// or that this thread was interrupted at every attempt to measure.
  [[nodiscard]] std::int64_t look() noexcept {
    constexpr std::int64_t kStepNs = 1'000'000;
    constexpr std::int64_t kTrustNs = 100'000;
    for (int attempt = 0; attempt < 3; ++attempt) {
      const std::int64_t before_ns = clock_.monotonic_ns();
      const std::int64_t tai_ns = clock_.tai_ns();
      if (clock_.monotonic_ns() - before_ns > kTrustNs) {
        continue;
      }
      const std::int64_t offset_ns = tai_ns - before_ns;
      const std::int64_t step_ns = offset_ns - offset_ns_.value_or(offset_ns);
      offset_ns_ = offset_ns;
      return std::abs(step_ns) > kStepNs ? step_ns : 0;
    }
    return 0;
  }

 private:
  const Clock& clock_;
  std::optional<std::int64_t> offset_ns_;  // wall less monotonic
};

}  // namespace emit::server
