// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

namespace emit::tool {

/// Time of a replay; injected, so that tests decide how it passes.
class ReplayClock {
 public:
  ReplayClock() = default;
  ReplayClock(const ReplayClock&) = delete;
  ReplayClock& operator=(const ReplayClock&) = delete;
  virtual ~ReplayClock() = default;

  /// Returns the time, ns; its origin is arbitrary, and it never steps.
  [[nodiscard]] virtual std::int64_t now_ns() = 0;
  /// Waits until that time. An interrupt of the command ends the wait.
  virtual void wait_until(std::int64_t time_ns) = 0;
};

/// The monotonic clock of the system.
class SystemReplayClock final : public ReplayClock {
 public:
  [[nodiscard]] std::int64_t now_ns() override;
  void wait_until(std::int64_t time_ns) override;
};

/// Spaces the frames of a replay as the recording did: a frame is due (w - w0) / speed after the
/// first one, where w is the wall time of its journal entry and w0 that of the first one's.
class ReplayPace {
 public:
  /// @param speed  multiple of the recorded pace, above 0; 0: frames are due at once
  ReplayPace(ReplayClock& clock, double speed) : clock_(clock), speed_(speed) {}

  /// Begins anew: the next frame is due at once, and those behind it are counted from it.
  void restart() noexcept { first_.reset(); }
  /// Waits until a frame is due and remembers how late it is.
  /// @param wall_time_ns  of its journal entry
  void wait_for(std::int64_t wall_time_ns);
  /// Returns the longest time that a frame came after it was due, ns.
  [[nodiscard]] std::int64_t latest_ns() const noexcept { return latest_ns_; }

 private:
  struct First {
    std::int64_t wall_ns = 0;
    std::int64_t clock_ns = 0;
  };
  ReplayClock& clock_;
  double speed_;
  std::optional<First> first_;
  std::int64_t latest_ns_ = 0;
};

}  // namespace emit::tool
