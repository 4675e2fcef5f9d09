// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/types.h>

#include <array>
#include <vector>

#include "threads/core_set.hpp"

namespace emit::threads {

/// Threads on which Mesa's llvmpipe draws and computes, one of each kind per core, and the cores on
/// which they run. When the kernel places them, two threads that are woken together often queue on
/// one core while another is idle, for up to a tick of 4 ms. All threads then wait for the last one
/// of each batch and dispatch.
///
/// Owner: EglContext. The driver shares its threads among contexts.
/// Thread: the one that submits.
class SoftwareThreads {
 public:
  /// Scope in which the calling thread has a name that its new threads inherit, so that find()
  /// recognises those to which Mesa gives no name.
  class Naming {
   public:
    Naming() noexcept;
    ~Naming();
    Naming(const Naming&) = delete;
    Naming& operator=(const Naming&) = delete;

   private:
    std::array<char, 16> before_{};
  };

  SoftwareThreads() = default;
  /// Finds the threads of this process that Mesa started within a Naming, and gives each compute
  /// thread a core of its own. A kind is empty unless it has as many threads as the caller has
  /// cores, at least two. The call waits until the threads have their names, half a second at most.
  /// Real time: setup only.
  [[nodiscard]] static SoftwareThreads find();

  /// Moves the raster threads away from the caller's core. Call it before submitting draws: tiles
  /// are then filled on the other cores while the caller submits. Real time: one system call per
  /// thread.
  void leave_core_to_caller() const noexcept;
  /// Gives each raster thread a core of its own again. Call it before waiting for submitted draws.
  /// Real time: one system call per thread.
  void spread() const noexcept;

  [[nodiscard]] const std::vector<pid_t>& raster() const noexcept { return raster_; }
  [[nodiscard]] const std::vector<pid_t>& compute() const noexcept { return compute_; }

 private:
  void list_threads();

  CoreSet cores_;
  std::vector<pid_t> raster_;   ///< raster threads, in the order of their numbers
  std::vector<pid_t> compute_;  ///< compute threads, ascending
};

}  // namespace emit::threads
