// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/types.h>

#include <array>
#include <vector>

#include "threads/core_set.hpp"

namespace emit::threads {

/// The threads on which Mesa's llvmpipe draws and computes, one of each per core, and where they
/// run. Left to the kernel, two that are woken at once often queue on one core while another has
/// nothing to do, up to a tick of 4 ms: all of them wait for the last of each batch and dispatch.
///
/// Owner: EglContext. Thread: the one that submits. The driver shares its threads among contexts.
class SoftwareThreads {
 public:
  /// While one lives, threads that the calling thread starts are named so that find() knows those
  /// to which Mesa gives no name of their own.
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
  /// Those of this process that Mesa started under a Naming; none unless there are as many as the
  /// caller has cores, at least two. Gives each compute thread its core. Waits until they have
  /// their names, half a second at most.
  [[nodiscard]] static SoftwareThreads find();

  /// Around draws: while the caller submits them, tiles are filled on the other cores; while it
  /// waits for what it has flushed, on all. Real time: a system call per thread and call.
  void leave_core_to_caller() const noexcept;
  void spread() const noexcept;

  [[nodiscard]] const std::vector<pid_t>& raster() const noexcept { return raster_; }
  [[nodiscard]] const std::vector<pid_t>& compute() const noexcept { return compute_; }

 private:
  void look_for_them();

  CoreSet cores_;
  std::vector<pid_t> raster_;   ///< in the order of their numbers
  std::vector<pid_t> compute_;  ///< ascending
};

}  // namespace emit::threads
