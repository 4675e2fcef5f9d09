// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "emit/physics/check.hpp"

namespace emit::server {

/// Simulation time as it passes, from poses that arrive with jitter. The delay of the network is
/// never less than its least value, so the earliest of the latest arrivals tells where the host
/// is, and a pose that is late or lost shifts nothing.
///
/// Pure. RT-safe.
class HostClock {
 public:
  /// An offset that differs by more than this for kJumpSpanNs is a jump of simulation time.
  static constexpr std::int64_t kJumpNs = 20'000'000;
  /// A burst of poses that the network held back is shorter than this.
  static constexpr std::int64_t kJumpSpanNs = 100'000'000;

  /// Takes note of a pose. Returns true if simulation time has jumped against time: forwards,
  /// backwards, or because the host paused.
  bool arrived(std::int64_t sim_time_ns, std::int64_t received_ns) noexcept {
    const std::int64_t offset_ns = received_ns - sim_time_ns;
    if (count_ > 0 && is_jump(offset_ns, received_ns)) {
      clear();
      take(offset_ns, received_ns);
      return true;
    }
    take(offset_ns, received_ns);
    return false;
  }
  void clear() noexcept { *this = {}; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

  /// Returns the simulation time at a wall instant.
  /// @pre !empty()
  [[nodiscard]] std::int64_t sim_time_ns(std::int64_t wall_ns) const noexcept {
    EMIT_DCHECK(!empty());
    return wall_ns - offset_ns_;
  }

 private:
  static constexpr std::size_t kKept = 64;
  static constexpr std::size_t kPosesOfJump = 4;
  /// The offset moves by one part in this number of the time that passes, twice what crystals
  /// drift.
  static constexpr std::int64_t kSlewDivisor = 5'000;

  /// Returns true if this offset and those before it lie beyond the jump for long enough.
  bool is_jump(std::int64_t offset_ns, std::int64_t received_ns) noexcept {
    const std::int64_t error_ns = offset_ns - offset_ns_;
    if (error_ns <= kJumpNs && error_ns >= -kJumpNs) {
      far_count_ = 0;
      return false;
    }
    // A pose that comes too early did not wait anywhere: simulation time has jumped, unless all
    // before it waited.
    if (error_ns < 0) return count_ == kKept || error_ns < -kJumpSpanNs;
    if (far_count_++ == 0) far_since_ns_ = received_ns;
    return far_count_ >= kPosesOfJump && received_ns - far_since_ns_ >= kJumpSpanNs;
  }
  void take(std::int64_t offset_ns, std::int64_t received_ns) noexcept {
    offsets_ns_[next_] = offset_ns;
    next_ = (next_ + 1) % kKept;
    count_ = std::min(count_ + 1, kKept);
    const std::int64_t least_ns = *std::min_element(
        offsets_ns_.begin(), offsets_ns_.begin() + static_cast<std::ptrdiff_t>(count_));
    // The first poses only find the least delay.
    if (count_ == 1 || (count_ < kKept && least_ns < offset_ns_)) {
      offset_ns_ = least_ns;
      updated_ns_ = received_ns;
      return;
    }
    // Follow the drift of two clocks slowly, so that the axes do not see it.
    const std::int64_t passed_ns = std::max<std::int64_t>(received_ns - updated_ns_, 0);
    updated_ns_ = std::max(updated_ns_, received_ns);
    const std::int64_t step_ns = passed_ns / kSlewDivisor;
    offset_ns_ += std::clamp(least_ns - offset_ns_, -step_ns, step_ns);
  }

  std::array<std::int64_t, kKept> offsets_ns_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
  std::int64_t offset_ns_ = 0;
  std::int64_t updated_ns_ = 0;
  std::size_t far_count_ = 0;  ///< poses in a row that came far too late
  std::int64_t far_since_ns_ = 0;
};

}  // namespace emit::server
