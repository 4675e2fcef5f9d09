// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>

#include "agents/context.hpp"
#include "agents/render/render_agent.hpp"

namespace emit::server {

/// Signs of life of the process: whether it serves, since when it runs, and when main last came
/// round. Threads: main writes unless a member says otherwise, the thread of the metrics reads.
struct Liveness {
  std::atomic<bool> serving{false};           ///< true from the start of the agents to the stop
  std::atomic<double> warmed_up_frac{0.0};    ///< 0 .. 1; by the render agent's thread
  std::atomic<std::int64_t> housekept_ns{0};  ///< monotonic
  std::int64_t started_ns = 0;                ///< monotonic; fixed before the metrics are served

  /// Notes the start of the process.
  void start(std::int64_t now_ns) noexcept {
    started_ns = now_ns;
    housekept_ns.store(now_ns, std::memory_order_release);
  }

  /// Returns true while host frames are taken and frames come: false while stopping, and while the
  /// surface warms up again behind a jump of simulation time. Thread: any.
  [[nodiscard]] bool is_ready(const Context& context) const noexcept {
    const std::int64_t since_ns = context.jump_since_ns.load(std::memory_order_relaxed);
    return serving.load(std::memory_order_acquire) &&
           !(since_ns != 0 && warms_up_again(context.clock.monotonic_ns() - since_ns));
  }

  /// Returns true unless main has not come round for 5 s. Thread: any.
  [[nodiscard]] bool is_main_alive(std::int64_t now_ns) const noexcept {
    constexpr std::int64_t kStuckNs = 5'000'000'000;
    return now_ns - housekept_ns.load(std::memory_order_acquire) < kStuckNs;
  }
};

}  // namespace emit::server
