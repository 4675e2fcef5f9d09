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

/// Threads that share loops with the one that calls: for work inside frames, where nothing may
/// allocate. They sleep while there is none, and a call waits for no thread that has not begun.
/// Where each can have a core of the constructing thread's they stay off the one that calls: the
/// kernel may wake them there, to wait behind the caller.
///
/// Owner: whoever calls run(), one thread at a time. Real time: run() allocates nothing, takes a
/// lock that is held for an instant only, and wakes threads, which it moves when the caller has
/// come to another core; construction is setup.
class WorkerPool {
 public:
  /// `threads` in all, the caller among them; at least 1.
  explicit WorkerPool(unsigned int threads);
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  ~WorkerPool();

  /// As many threads as the process may run on.
  [[nodiscard]] static unsigned int all_cores() noexcept;

  /// body(begin, end) over parts of [0, count) of at most `grain` >= 1. The parts go to whoever is
  /// free: bodies must not depend on them. What the caller wrote before is read by the bodies and
  /// the other way round. Bodies must not throw.
  template <class Body>
  void run(std::size_t count, std::size_t grain, const Body& body) noexcept {
    run_loop({[](const void* self, std::size_t begin, std::size_t end) {
                (*static_cast<const Body*>(self))(begin, end);
              },
              &body, count, grain});
  }

 private:
  struct Loop {
    void (*call)(const void* body, std::size_t begin, std::size_t end) = nullptr;
    const void* body = nullptr;
    std::size_t count = 0;
    std::size_t grain = 1;
  };
  void run_loop(const Loop& loop) noexcept;
  /// Takes parts of the open loop until none is left.
  void take_parts(const Loop& loop) noexcept;
  void work() noexcept;
  void leave_core_to_caller() noexcept;

  std::mutex mutex_;
  std::condition_variable begun_;
  std::condition_variable left_;
  Loop loop_;                      ///< guarded by mutex_, like the next four
  unsigned long long number_ = 0;  ///< of the loop
  bool open_ = false;              ///< threads may enter the loop
  unsigned int inside_ = 0;        ///< threads, the caller not counted
  bool stop_ = false;
  std::atomic<std::size_t> next_{0};  ///< first index of the next part
  CoreSet cores_;
  std::vector<pid_t> ids_;  ///< of the threads that have come up; guarded by mutex_
  int left_core_ = -1;      ///< where `placed_` of them do not run
  std::size_t placed_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace emit::threads
