// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::server {

/// Simulation time as it passes, from poses that arrive with jitter. The delay of the network is
/// never less than its least value, so the earliest of the latest arrivals tells where the host
/// is, and a pose that is late or lost shifts nothing.
///
/// Pure. RT-safe.
class HostClock {
 public:
  /// Takes note of a pose. Returns true if simulation time has jumped against time.
  bool arrived(std::int64_t sim_time_ns, std::int64_t received_ns) noexcept {
    const std::int64_t offset_ns = received_ns - sim_time_ns;
    offsets_ns_[next_] = offset_ns;
    next_ = (next_ + 1) % offsets_ns_.size();
    count_ = std::min(count_ + 1, offsets_ns_.size());
    const std::int64_t least_ns = *std::min_element(
        offsets_ns_.begin(), offsets_ns_.begin() + static_cast<std::ptrdiff_t>(count_));
    // The first poses only find the least delay.
    if (count_ == 1 || (searching_ && least_ns < offset_ns_)) {
      searching_ = count_ < offsets_ns_.size();
      offset_ns_ = least_ns;
      updated_ns_ = received_ns;
      return false;
    }
    searching_ = searching_ && count_ < offsets_ns_.size();
    // Follow the drift of two clocks slowly, so that the axes do not see it.
    const std::int64_t passed_ns = std::max<std::int64_t>(received_ns - updated_ns_, 0);
    updated_ns_ = std::max(updated_ns_, received_ns);
    const std::int64_t step_ns = passed_ns / kSlewDivisor;
    const std::int64_t error_ns = least_ns - offset_ns_;
    if (error_ns > kJumpNs || error_ns < -kJumpNs) {
      offset_ns_ = offset_ns;
      offsets_ns_[0] = offset_ns;
      next_ = 1;
      count_ = 1;
      searching_ = true;
      return true;
    }
    offset_ns_ += std::clamp(error_ns, -step_ns, step_ns);
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
  /// A change of the offset beyond this is a jump of simulation time.
  static constexpr std::int64_t kJumpNs = 20'000'000;
  /// The offset moves by one part in this number of the time that passes, twice what crystals
  /// drift.
  static constexpr std::int64_t kSlewDivisor = 5'000;

  std::array<std::int64_t, kKept> offsets_ns_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
  std::int64_t offset_ns_ = 0;
  std::int64_t updated_ns_ = 0;
  bool searching_ = true;
};

}  // namespace emit::server
