// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "rt/spsc_ring.hpp"

namespace emit::server {

/// Evidence of how long one turn of an agent takes. One writer, any reader. RT-safe.
class alignas(kCacheLineBytes) DutyCycle {
 public:
  explicit DutyCycle(std::int64_t threshold_ns = 1'000'000) : threshold_ns_(threshold_ns) {}

  void record(std::int64_t duration_ns) noexcept {
    if (duration_ns > max_ns_.load(std::memory_order_relaxed)) {
      max_ns_.store(duration_ns, std::memory_order_relaxed);
    }
    if (duration_ns > threshold_ns_) {
      over_.store(over_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    }
    busy_ns_.store(busy_ns_.load(std::memory_order_relaxed) + duration_ns,
                   std::memory_order_relaxed);
    cycles_.store(cycles_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }

  /// Every time the agent comes round, working or not: at least each 100 ms.
  void beat(std::int64_t monotonic_ns) noexcept {
    beat_ns_.store(monotonic_ns, std::memory_order_relaxed);
  }
  /// Since the last beat; 0 before the first: nothing is expected of an agent that has not begun.
  [[nodiscard]] std::int64_t silent_ns(std::int64_t monotonic_ns) const noexcept {
    const std::int64_t beat_ns = beat_ns_.load(std::memory_order_relaxed);
    return beat_ns == 0 || monotonic_ns < beat_ns ? 0 : monotonic_ns - beat_ns;
  }

  [[nodiscard]] std::int64_t max_ns() const noexcept {
    return max_ns_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t over_threshold() const noexcept {
    return over_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::int64_t busy_ns() const noexcept {
    return busy_ns_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t cycles() const noexcept {
    return cycles_.load(std::memory_order_relaxed);
  }

 private:
  std::int64_t threshold_ns_;
  std::atomic<std::int64_t> max_ns_{0};
  std::atomic<std::uint64_t> over_{0};
  std::atomic<std::int64_t> busy_ns_{0};
  std::atomic<std::uint64_t> cycles_{0};
  std::atomic<std::int64_t> beat_ns_{0};
};

/// Duty cycles of several agents, each with the agent's name.
using NamedDutyCycles = std::vector<std::pair<std::string, const DutyCycle*>>;

}  // namespace emit::server
