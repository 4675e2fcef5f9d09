// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sched.h>
#include <sys/types.h>

#include <cstddef>

namespace emit::threads {

/// Cores of this machine, by the numbers that the kernel gives them.
class CoreSet {
 public:
  CoreSet() noexcept { CPU_ZERO(&cores_); }
  /// Where a thread may run, 0 = the caller; empty where the kernel does not say, as for one that
  /// has ended.
  [[nodiscard]] static CoreSet of(pid_t thread) noexcept;

  [[nodiscard]] int count() const noexcept { return CPU_COUNT(&cores_); }
  /// `core` < 0, as when sched_getcpu() fails: all.
  [[nodiscard]] CoreSet without(int core) const noexcept;
  /// One of them alone, the `index`th from below. Precondition: index < count().
  [[nodiscard]] CoreSet only(std::size_t index) const noexcept;

  /// From now on the thread runs here; where it runs elsewhere it is moved at once. An empty set,
  /// and what the kernel refuses, change nothing. Real time: one system call.
  void give_to(pid_t thread) const noexcept;

  [[nodiscard]] bool operator==(const CoreSet& other) const noexcept {
    return CPU_EQUAL(&cores_, &other.cores_) != 0;
  }

 private:
  cpu_set_t cores_;
};

}  // namespace emit::threads
