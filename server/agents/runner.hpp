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

  /// Before start_thread(). Stepped mode asks nothing of the host.
  /// A setting that the host refuses is left out; the daemon has asked for the same before and
  /// logged it.
  void set_realtime(ThreadRealtime wish) { realtime_ = std::move(wish); }

  /// Starts the thread and waits for on_start. False when on_start failed; the thread is gone then.
  [[nodiscard]] bool start_thread();
  /// Stepped mode: on_start on the caller's thread.
  [[nodiscard]] bool start_stepped();
  int step() noexcept;
  /// Ends after the current turn, runs on_stop, joins. Idempotent.
  void stop() noexcept;

  [[nodiscard]] Agent& agent() noexcept { return agent_; }
  [[nodiscard]] const DutyCycle& duty_cycle() const noexcept { return duty_; }

 private:
  void run() noexcept;
  int turn() noexcept;
  void rest() noexcept;
  void sleep() noexcept;
  /// Sets the timer to a wall instant, for good until it is set anew. False: there is none.
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
