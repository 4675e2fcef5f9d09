// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>

#include "rt/fd.hpp"

namespace emit::server {

/// Wakes a sleeping agent. A ring costs one atomic exchange while the agent is awake and one write
/// to an eventfd when it sleeps.
///
/// The agent arms, looks for work once more, and only then polls fd(). Both sides exchange the same
/// atomic, so either the ringer sees it armed or the agent's last look sees the work.
/// Thread: ring() any; the rest the agent's. Real time: RT-safe.
class Doorbell {
 public:
  Doorbell();

  void ring() noexcept;
  void arm() noexcept { armed_.exchange(true, std::memory_order_acq_rel); }
  /// After the sleep: forgets rings.
  void disarm() noexcept;
  [[nodiscard]] int fd() const noexcept { return fd_.get(); }

 private:
  Fd fd_;
  std::atomic<bool> armed_{false};
};

}  // namespace emit::server
