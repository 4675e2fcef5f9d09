// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "emit/protocol/control.hpp"

namespace emit::server {

using protocol::CommandKind;

/// Start, stop, hold and step; reset is the conductor's. Pure. RT-safe.
///
/// - stopped: no frames, inputs are still taken.
/// - held: frames go on, their thermal clock stands still.
/// - step: one frame although stopped; while held its thermal clock is brought up to its sim time
///   first and stands there again.
/// - start ends both.
class RunControl {
 public:
  /// False: not possible now (step while neither held nor stopped).
  [[nodiscard]] bool apply(CommandKind command) noexcept {
    switch (command) {
      case CommandKind::start:
        running_ = true;
        held_ = false;
        held_thermal_ns_.reset();
        return true;
      case CommandKind::stop:
        running_ = false;
        return true;
      case CommandKind::hold:
        held_ = true;
        return true;
      case CommandKind::step:
        if (running_ && !held_) {
          return false;
        }
        ++steps_;
        return true;
      case CommandKind::reset:
        *this = RunControl{};
        return true;
    }
    return false;
  }

  /// A new run of the host: stop and hold stay, instants of the old run mean nothing any more.
  void new_run() noexcept {
    held_thermal_ns_.reset();
    last_thermal_ns_.reset();
  }

  [[nodiscard]] bool running() const noexcept { return running_; }
  [[nodiscard]] bool held() const noexcept { return held_; }
  [[nodiscard]] bool step_pending() const noexcept { return steps_ > 0; }

  /// Returns the thermal clock of a frame at `sim_time_ns`. Call it once per frame, in order.
  /// @param is_step  the frame answers a step
  [[nodiscard]] std::int64_t thermal_time_ns(std::int64_t sim_time_ns, bool is_step) noexcept {
    if (is_step && steps_ > 0) {
      --steps_;
      held_thermal_ns_.reset();
    }
    if (!held_) {
      last_thermal_ns_ = sim_time_ns;
      return sim_time_ns;
    }
    if (!held_thermal_ns_) {
      // A hold keeps the instant of the last frame before it; a step, or a hold before any frame,
      // the instant of this one.
      held_thermal_ns_ = is_step ? sim_time_ns : last_thermal_ns_.value_or(sim_time_ns);
    }
    last_thermal_ns_ = *held_thermal_ns_;
    return *held_thermal_ns_;
  }

 private:
  bool running_ = true;
  bool held_ = false;
  std::uint32_t steps_ = 0;
  std::optional<std::int64_t> held_thermal_ns_;
  std::optional<std::int64_t> last_thermal_ns_;
};

}  // namespace emit::server
