// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <csignal>

namespace emit::tool {

/// From construction to destruction SIGINT and SIGTERM only set a flag, so that a long command can
/// finish its files and print what it has. One instance at a time.
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
