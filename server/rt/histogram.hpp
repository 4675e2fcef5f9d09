// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace emit::server {

/// Distribution of durations, in steps of 1, 2, 5 from 10 us to 10 s.
///
/// Thread: any may record and read; a reader may see a count whose sum is still to come. Real time:
/// RT-safe.
class Histogram {
 public:
  /// Upper ends of the buckets, ns, inclusive; one more bucket takes what is longer.
  static constexpr std::array<std::int64_t, 19> kUpperNs{
      10'000,        20'000,        50'000,        100'000,       200'000,
      500'000,       1'000'000,     2'000'000,     5'000'000,     10'000'000,
      20'000'000,    50'000'000,    100'000'000,   200'000'000,   500'000'000,
      1'000'000'000, 2'000'000'000, 5'000'000'000, 10'000'000'000};
  static constexpr std::size_t kBuckets = kUpperNs.size() + 1;

  /// Negative durations, of clocks that were set in between, count as 0.
  void record(std::int64_t duration_ns) noexcept {
    const std::int64_t counted_ns = std::max<std::int64_t>(duration_ns, 0);
    const auto bucket = static_cast<std::size_t>(
        std::lower_bound(kUpperNs.begin(), kUpperNs.end(), counted_ns) - kUpperNs.begin());
    counts_[bucket].fetch_add(1, std::memory_order_relaxed);
    sum_ns_.fetch_add(static_cast<std::uint64_t>(counted_ns), std::memory_order_relaxed);
  }

  /// Returns the count of one bucket alone.
  [[nodiscard]] std::uint64_t count(std::size_t bucket) const noexcept {
    return counts_[bucket].load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t sum_ns() const noexcept {
    return sum_ns_.load(std::memory_order_relaxed);
  }

 private:
  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::uint64_t> sum_ns_{0};
};

/// Times of frames by stage. A frame counts once in the first four, and once per client that it was
/// sent to in those of sending. Repeated frames count in the latter alone.
struct FrameTimes {
  Histogram wait;               ///< pose received to start of rendering
  Histogram render;             ///< start of rendering to device finished
  Histogram readback;           ///< device finished to pixels visible to the CPU
  Histogram frame;              ///< start of rendering to pixels visible to the CPU
  Histogram send;               ///< first byte handed to the kernel to last byte
  Histogram pose_to_last_byte;  ///< pose received to last byte handed to the kernel
  Histogram jitter;             ///< |difference of two consecutive pose_to_last_byte| of a client
  Histogram sim_age;            ///< sim time passed since the instant shown, at the last byte
  Histogram sampling;           ///< ig-clock, trigger: pose received to begin of its slot
};

}  // namespace emit::server
