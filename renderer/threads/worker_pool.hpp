// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/types.h>

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <thread>
#include <vector>

#include "threads/core_set.hpp"

namespace emit::threads {

/// Pool of threads that share loops with the calling thread, for work within frames, where nothing
/// may allocate. The threads sleep while there is no work, and a call does not wait for a thread
/// that has not begun. While there is a core for each thread, they stay off the caller's core,
/// because the kernel may wake them there and let them wait behind the caller.
///
/// Owner: the thread that calls run(), one thread at a time. Real time: construction is setup.
/// run() allocates nothing. It takes a lock that is held only briefly, and wakes the threads; it
/// moves them when the caller has changed its core.
class WorkerPool {
 public:
  /// Starts the pool. `threads` is the total number, including the caller; 0 counts as 1. When the
  /// system refuses a thread, the pool is smaller.
  explicit WorkerPool(unsigned int threads);
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  ~WorkerPool();

  /// Returns the number of cores on which the process may run, at least 1.
  [[nodiscard]] static unsigned int all_cores() noexcept;

  /// Calls body(begin, end) for parts of [0, count) of at most `grain` indices. Any free thread
  /// takes the next part, so a result must not depend on the parts. Bodies see what the caller
  /// wrote before the call, and the caller sees what they wrote. Bodies must not throw.
  /// @pre grain > 0
  template <class Body>
  void run(std::size_t count, std::size_t grain, const Body& body) noexcept {
    run_loop({[](const void* self, std::size_t begin, std::size_t end) {
                (*static_cast<const Body*>(self))(begin, end);
              },
              &body, count, grain});
  }

 private:
  /// Loop in work.
  struct Loop {
    void (*call)(const void* body, std::size_t begin, std::size_t end) = nullptr;
    const void* body = nullptr;
    std::size_t count = 0;
    std::size_t grain = 1;
  };
  void run_loop(const Loop& loop) noexcept;
  /// Executes parts of the open loop until none is left.
  void take_parts(const Loop& loop) noexcept;
  void work() noexcept;
  void leave_core_to_caller() noexcept;

  std::mutex mutex_;
  std::condition_variable begun_;
  std::condition_variable left_;
  Loop loop_;                      ///< guarded by mutex_, like the next four members
  unsigned long long number_ = 0;  ///< number of the loop, from 1
  bool open_ = false;              ///< true while threads may enter the loop
  unsigned int inside_ = 0;        ///< number of threads in the loop, without the caller
  bool stop_ = false;
  std::atomic<std::size_t> next_{0};  ///< first index of the next part
  CoreSet cores_;
  std::vector<pid_t> ids_;  ///< ids of the threads that have started; guarded by mutex_
  /// Core that the first `placed_` threads of ids_ avoid; -1: none yet.
  int left_core_ = -1;
  std::size_t placed_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace emit::threads
