// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>

#include "rt/spsc_ring.hpp"

namespace emit::server {

/// Counts of one connection, by its place in the receiver's table. The receiver sets whose the
/// place is, the sender counts, and any thread reads. Real time: RT-safe.
struct alignas(kCacheLineBytes) ClientCounts {
  std::atomic<std::uint32_t> connection{0};  ///< key of the connection that has the place; 0: none
  std::atomic<std::uint64_t> frames{0};      ///< sent completely
  std::atomic<std::uint64_t> skipped{0};     ///< it was slow, or an image missed its number
  std::atomic<std::int64_t> delay_ns{0};     ///< of the last frame: pose received to last byte sent
  std::atomic<std::int64_t> jitter_ns{0};    ///< of delay_ns, smoothed (FrameHeader)

  /// Begins the counts of a new connection.
  void begin(std::uint32_t key) noexcept {
    frames.store(0, std::memory_order_relaxed);
    skipped.store(0, std::memory_order_relaxed);
    delay_ns.store(0, std::memory_order_relaxed);
    jitter_ns.store(0, std::memory_order_relaxed);
    connection.store(key, std::memory_order_release);
  }
  void end() noexcept { connection.store(0, std::memory_order_release); }
};

}  // namespace emit::server
