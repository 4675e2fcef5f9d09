// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/physics/check.hpp"

namespace emit::server {

/// Slots of the image generator's own clock: slot n begins at origin + n / rate, on the wall clock,
/// without drift. Pure: the caller says what time it is. RT-safe.
class IgClock {
 public:
  /// @pre rate_hz > 0
  explicit IgClock(double rate_hz) noexcept : rate_hz_(rate_hz) { EMIT_CHECK_OP(rate_hz, >, 0.0); }

  /// Slot 0 begins now.
  void start(std::int64_t now_ns) noexcept {
    origin_ns_ = now_ns;
    slot_ = 0;
  }
  [[nodiscard]] std::uint64_t slot() const noexcept { return slot_; }
  [[nodiscard]] std::int64_t begin_ns() const noexcept { return edge_ns(slot_); }
  [[nodiscard]] std::int64_t end_ns() const noexcept { return edge_ns(slot_ + 1); }
  [[nodiscard]] std::int64_t period_ns() const noexcept {
    return static_cast<std::int64_t>(1e9 / rate_hz_);
  }

  /// Moves to the next slot. When the caller comes so late that further whole slots have passed
  /// (it did not run, or the wall clock stepped), they are skipped and counted here; a wall clock
  /// stepped back starts the slots anew. Returns the number of slots skipped.
  std::uint64_t advance(std::int64_t now_ns) noexcept {
    ++slot_;
    constexpr std::int64_t kSkipAfterSlots = 4;
    if (now_ns - end_ns() > kSkipAfterSlots * period_ns()) {
      const auto target =
          static_cast<std::uint64_t>(static_cast<double>(now_ns - origin_ns_) * 1e-9 * rate_hz_);
      if (target > slot_) {
        const std::uint64_t skipped = target - slot_;
        slot_ = target;
        return skipped;
      }
    }
    return 0;
  }
  /// True when the wall clock was set back so far that the slots lie in the future.
  [[nodiscard]] bool must_restart(std::int64_t now_ns) const noexcept {
    return begin_ns() - now_ns > 4 * period_ns();
  }

 private:
  [[nodiscard]] std::int64_t edge_ns(std::uint64_t slot) const noexcept {
    // Double holds the offset to better than 1 us for three years.
    return origin_ns_ + static_cast<std::int64_t>(static_cast<double>(slot) * (1e9 / rate_hz_));
  }

  double rate_hz_;
  std::int64_t origin_ns_ = 0;
  std::uint64_t slot_ = 0;
};

}  // namespace emit::server
