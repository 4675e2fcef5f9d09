// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <memory>
#include <thread>
#include <utility>

#include "agents/agent.hpp"
#include "host/realtime.hpp"
#include "rt/clock.hpp"
#include "rt/fd.hpp"
#include "telemetry/duty_cycle.hpp"

namespace emit::server {

/// Drives one agent: on a thread of its own, or stepped by the caller.
///
/// A thread that finds no work sleeps in ppoll until its doorbell rings, its descriptor turns
/// readable or its wake instant comes, by an absolute timer; it never spins, so that emitd shares
/// small machines.
class AgentRunner {
 public:
  AgentRunner(Agent& agent, const Clock& clock) : agent_(agent), clock_(clock) {}
  ~AgentRunner() { stop(); }
  AgentRunner(const AgentRunner&) = delete;
  AgentRunner& operator=(const AgentRunner&) = delete;

  /// Sets the real-time settings of the thread. Call it before start_thread(); stepped mode asks
  /// nothing of the host. A setting that the host refuses is left out. The daemon has asked for the
  /// same before and logged it.
  void set_realtime(ThreadRealtime wish) { realtime_ = std::move(wish); }

  /// Starts the thread and waits for on_start. It returns false when on_start failed; the thread
  /// has ended then.
  [[nodiscard]] bool start_thread();
  /// Starts the agent in stepped mode: on_start runs on the caller's thread.
  [[nodiscard]] bool start_stepped();
  int step() noexcept;
  /// Ends the agent after the current turn, runs on_stop and joins the thread. Idempotent.
  void stop() noexcept;

  [[nodiscard]] Agent& agent() noexcept { return agent_; }
  [[nodiscard]] const DutyCycle& duty_cycle() const noexcept { return duty_; }

 private:
  void run() noexcept;
  int turn() noexcept;
  void rest() noexcept;
  void sleep() noexcept;
  /// Sets the timer to a wall instant. It stays until it is set anew. Returns false when there is
  /// none.
  [[nodiscard]] bool arm_timer(std::int64_t wake_ns) noexcept;

  Agent& agent_;
  const Clock& clock_;
  DutyCycle duty_;
  ThreadRealtime realtime_;
  Fd timer_;  // on the agent's thread alone, as the next
  std::int64_t armed_utc_ns_ = 0;
  std::atomic<bool> stop_{false};
  enum class State : int { idle, starting, running, failed };
  std::atomic<int> state_{0};
  bool stepped_ = false;
  std::thread thread_;
};

}  // namespace emit::server
