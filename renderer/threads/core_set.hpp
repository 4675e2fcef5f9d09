// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sched.h>
#include <sys/types.h>

#include <cstddef>

namespace emit::threads {

/// Set of cores of this machine, by the numbers that the kernel gives them.
/// Thread: any number of threads may call const functions.  Real time: RT-safe; of() and give_to()
/// make one system call.
class CoreSet {
 public:
  CoreSet() noexcept { CPU_ZERO(&cores_); }
  /// Returns the cores on which a thread may run; 0 is the calling thread. The set is empty when
  /// the kernel does not answer, for example for a thread that has ended.
  [[nodiscard]] static CoreSet of(pid_t thread) noexcept;

  [[nodiscard]] int count() const noexcept { return CPU_COUNT(&cores_); }
  /// Returns the set without one core. A negative `core`, as sched_getcpu() returns on failure,
  /// removes none.
  [[nodiscard]] CoreSet without(int core) const noexcept;
  /// Returns a set that holds one core alone: the `index`th of this set, in ascending order.
  /// @pre index < count()
  [[nodiscard]] CoreSet only(std::size_t index) const noexcept;

  /// Restricts a thread to these cores. The kernel moves it at once when it runs on another core.
  /// Nothing changes when the set is empty or the kernel refuses.
  void give_to(pid_t thread) const noexcept;

  [[nodiscard]] bool operator==(const CoreSet& other) const noexcept {
    return CPU_EQUAL(&cores_, &other.cores_) != 0;
  }

 private:
  cpu_set_t cores_;
};

}  // namespace emit::threads
