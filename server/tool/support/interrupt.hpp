// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <csignal>

namespace emit::tool {

/// Guard that turns SIGINT and SIGTERM into a flag while it exists, so that a long command can
/// finish its files and print its results. One instance at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  [[nodiscard]] static bool interrupted() noexcept;

 private:
  struct sigaction old_int_ {};
  struct sigaction old_term_ {};
};

}  // namespace emit::tool
