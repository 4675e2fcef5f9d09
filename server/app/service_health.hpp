// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "app/service_notifier.hpp"
#include "telemetry/duty_cycle.hpp"

namespace emit::server {

/// Messages to the service manager: progress of the start, ready, alive, stopping. Alive is sent as
/// long as every agent completes its turns. Thread: main, except warming_up().
class ServiceHealth {
 public:
  /// Time without a completed turn after which an agent is stuck. The render agent of a slow
  /// software renderer may take seconds for a frame.
  static constexpr std::int64_t kStuckNs = 30'000'000'000;

  explicit ServiceHealth(const ServiceNotifier& notifier) : notifier_(notifier) {}

  /// Returns the first agent silent for longer than that; empty: none.
  [[nodiscard]] static std::string_view stuck_agent(const NamedDutyCycles& agents,
                                                    std::int64_t now_ns,
                                                    std::int64_t limit_ns) noexcept {
    for (const auto& [name, duty] : agents) {
      if (duty->silent_ns(now_ns) > limit_ns) return name;
    }
    return {};
  }

  void starting() const { notifier_.status("loading scene and device", kStartPieceS); }
  /// Reports the progress of the warm-up and returns true. Thread: the render agent's.
  bool warming_up(double done_frac) {
    const int percent = static_cast<int>(done_frac * 100.0);
    if (percent != told_percent_) {
      told_percent_ = percent;
      notifier_.status("warming up: " + std::to_string(percent) + " %", kStartPieceS);
    }
    return true;
  }
  void ready(std::string_view status) const { notifier_.ready(status); }
  void stopping() const { notifier_.stopping(); }

  /// Runs once per turn of main while serving. It reports to the manager that the daemon is alive,
  /// twice within the time the manager waits, unless an agent is stuck.
  /// @return the agent that is stuck, once for each time it gets stuck; else empty.
  [[nodiscard]] std::string_view turn(const NamedDutyCycles& agents, std::int64_t now_ns) {
    const std::int64_t watchdog_ns = notifier_.watchdog_ns();
    const std::int64_t limit_ns = watchdog_ns > 0 ? watchdog_ns : kStuckNs;
    const std::string_view stuck = stuck_agent(agents, now_ns, limit_ns);
    if (!stuck.empty()) return std::exchange(told_stuck_, true) ? std::string_view{} : stuck;
    told_stuck_ = false;
    if (watchdog_ns > 0 && now_ns - alive_ns_ >= watchdog_ns / 4) {
      alive_ns_ = now_ns;
      notifier_.alive();
    }
    return {};
  }

 private:
  /// Longest time between two progress messages of the start.
  static constexpr std::int64_t kStartPieceS = 300;

  const ServiceNotifier& notifier_;
  int told_percent_ = -1;
  bool told_stuck_ = false;
  std::int64_t alive_ns_ = 0;
};

}  // namespace emit::server
