// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::server {

/// Time as every agent sees it; injected, so that tests decide what time it is.
/// Thread: any. Real time: RT-safe.
class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  /// Wall instant, ns of CLOCK_TAI. Equal to UTC while tai_offset_unset().
  [[nodiscard]] virtual std::int64_t tai_ns() const noexcept = 0;
  /// Clock for durations, ns: its origin is arbitrary, and it never steps.
  [[nodiscard]] virtual std::int64_t monotonic_ns() const noexcept = 0;
  /// TAI - UTC as the kernel has it now, ns. 0 = unset.
  [[nodiscard]] virtual std::int64_t tai_from_utc_offset_ns() const noexcept = 0;
  /// Receive time stamps of the kernel are UTC; this one on the clock of tai_ns().
  [[nodiscard]] virtual std::int64_t tai_from_kernel_stamp_ns(
      std::int64_t kernel_utc_ns) const noexcept {
    return kernel_utc_ns + tai_from_utc_offset_ns();
  }

  [[nodiscard]] bool tai_offset_unset() const noexcept { return tai_from_utc_offset_ns() == 0; }
};

class SystemClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t tai_ns() const noexcept override;
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override;
  [[nodiscard]] std::int64_t tai_from_utc_offset_ns() const noexcept override;
};

}  // namespace emit::server
