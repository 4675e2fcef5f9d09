// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/replay_pace.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "tool/support/interrupt.hpp"

namespace emit::tool {

std::int64_t SystemReplayClock::now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void SystemReplayClock::wait_until(std::int64_t time_ns) {
  // A signal does not end a sleep of the library, so that long waits are cut into short ones.
  constexpr std::int64_t kSliceNs = 50'000'000;
  while (!InterruptGuard::interrupted()) {
    const std::int64_t left_ns = time_ns - now_ns();
    if (left_ns <= 0) return;
    std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(left_ns, kSliceNs)));
  }
}

void ReplayPace::wait_for(std::int64_t wall_time_ns) {
  if (speed_ <= 0.0) return;
  if (!first_) {
    first_ = First{wall_time_ns, clock_.now_ns()};
    return;
  }
  const double after_ns = static_cast<double>(wall_time_ns - first_->wall_ns) / speed_;
  const std::int64_t due_ns = first_->clock_ns + std::llround(after_ns);
  clock_.wait_until(due_ns);
  latest_ns_ = std::max(latest_ns_, clock_.now_ns() - due_ns);
}

}  // namespace emit::tool
