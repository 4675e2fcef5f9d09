// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace emit::server {

/// Rate limiter (leaky bucket) of one connection, in nanoseconds of debt. Every message costs time,
/// and the messages of a quarter of a second may come at once. A connection in debt is not read:
/// its bytes wait in the kernel's buffers until the sender's own window is full, which costs nobody
/// else anything. Thread: one owner. Real time: RT-safe.
class ReadPace {
 public:
  static constexpr std::int64_t kBurstNs = 250'000'000;
  /// Cost of a refusal: an answer takes a system call and more, so there may be 100 a second.
  static constexpr std::int64_t kRefusalNs = 10'000'000;
  /// Cost of a byte: about 64 MiB a second.
  static constexpr std::int64_t kByteNs = 15;
  /// Time to spare before reading goes on, so that it seldom stops.
  static constexpr std::int64_t kRestNs = 10'000'000;

  /// `records_hz` is not 0.
  explicit ReadPace(std::uint32_t records_hz = 1) noexcept
      : record_ns_(1'000'000'000 / records_hz) {}

  // Costs are charged at `now_ns`, monotonic.
  void bytes(std::size_t count, std::int64_t now_ns) noexcept {
    pay(static_cast<std::int64_t>(count) * kByteNs, now_ns);
  }
  void record(std::int64_t now_ns) noexcept { pay(record_ns_, now_ns); }
  void refusal(std::int64_t now_ns) noexcept { pay(kRefusalNs, now_ns); }

  [[nodiscard]] bool in_debt(std::int64_t now_ns) const noexcept { return paid_ns_ > now_ns; }
  /// Returns the time until the connection may be read again after it was in debt; 0 or less: now.
  [[nodiscard]] std::int64_t wait_ns(std::int64_t now_ns) const noexcept {
    return paid_ns_ + kRestNs - now_ns;
  }

 private:
  void pay(std::int64_t cost_ns, std::int64_t now_ns) noexcept {
    // The debt is stored as the instant at which everything so far is paid for.
    paid_ns_ = std::max(paid_ns_, now_ns - kBurstNs) + cost_ns;
  }

  std::int64_t record_ns_;
  std::int64_t paid_ns_ = INT64_MIN / 2;
};

}  // namespace emit::server
