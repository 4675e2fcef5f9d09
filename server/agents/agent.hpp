// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <limits>
#include <string_view>

#include "rt/doorbell.hpp"

namespace emit::server {

inline constexpr std::int64_t kNeverNs = std::numeric_limits<std::int64_t>::max();

/// A piece of the daemon that owns its state alone and talks to the others through rings. One
/// thread drives an agent; which one is the runner's business (docs/threading.md).
class Agent {
 public:
  explicit Agent(Doorbell& doorbell) noexcept : doorbell_(doorbell) {}
  Agent(const Agent&) = delete;
  Agent& operator=(const Agent&) = delete;
  virtual ~Agent() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;

  /// Prepares the agent, on its thread, before the first do_work(). Returns false when the daemon
  /// must not start.
  [[nodiscard]] virtual bool on_start() noexcept { return true; }
  /// Does what there is to do now, without waiting. Returns the amount of work done; 0 = idle.
  /// RT-safe: no allocation, no lock, no log, unless the agent says otherwise.
  virtual int do_work(std::int64_t now_ns) noexcept = 0;
  /// Ends the agent, on its thread, after the last do_work().
  virtual void on_stop() noexcept {}

  /// Returns the TAI instant at which do_work must be called even if nothing else happens.
  [[nodiscard]] virtual std::int64_t wake_at_ns() const noexcept { return kNeverNs; }
  /// Returns the shortest time between work and the next look; 0 for most agents. An agent that is
  /// not urgent lets work pile up and spares its producers the waking.
  [[nodiscard]] virtual std::int64_t rest_ns() const noexcept { return 0; }
  /// Returns a descriptor that is readable when the outside world has work for this agent (an epoll
  /// descriptor); -1: none.
  [[nodiscard]] virtual int wait_fd() const noexcept { return -1; }

  /// Doorbell of this agent. A producer rings it after it put something on one of the agent's
  /// rings.
  [[nodiscard]] Doorbell& doorbell() const noexcept { return doorbell_; }

 private:
  Doorbell& doorbell_;
};

}  // namespace emit::server
