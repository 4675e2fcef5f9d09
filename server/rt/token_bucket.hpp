// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>

namespace emit::server {

/// Token bucket: lets a rate through, and a burst of a quarter of a second at once. Thread: one
/// owner. Real time: RT-safe.
class TokenBucket {
 public:
  /// `rate_hz`: 1 .. 1e7.
  explicit TokenBucket(std::uint32_t rate_hz = 1) noexcept
      : cost_ns_(1'000'000'000 / std::int64_t{std::max(rate_hz, 1U)}),
        burst_ns_(std::max<std::int64_t>(250'000'000, cost_ns_)) {}

  /// True: one more is within the rate. Time that goes back counts as standing still.
  [[nodiscard]] bool take(std::int64_t now_ns) noexcept {
    // Kept as the instant at which everything taken so far is paid for.
    const std::int64_t paid_ns = std::max(paid_ns_, now_ns - burst_ns_);
    if (paid_ns + cost_ns_ > now_ns) return false;
    paid_ns_ = paid_ns + cost_ns_;
    return true;
  }

 private:
  std::int64_t cost_ns_;
  std::int64_t burst_ns_;
  std::int64_t paid_ns_ = INT64_MIN / 2;
};

}  // namespace emit::server
