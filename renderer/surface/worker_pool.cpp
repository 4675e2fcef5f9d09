// SPDX-License-Identifier: Apache-2.0
#include "surface/worker_pool.hpp"

#include <sched.h>

#include <algorithm>
#include <system_error>

namespace emit::renderer {

WorkerPool::WorkerPool(unsigned int threads) {
  threads_.reserve(threads);
  try {
    for (unsigned int i = 1; i < threads; ++i) threads_.emplace_back([this] { work(); });
  } catch (const std::system_error&) {
    // The system has no more: results do not depend on how many there are.
  }
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  begun_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

unsigned int WorkerPool::all_cores() noexcept {
  cpu_set_t cores;
  if (sched_getaffinity(0, sizeof(cores), &cores) == 0) {
    return static_cast<unsigned int>(std::max(1, CPU_COUNT(&cores)));
  }
  return std::max(1U, std::thread::hardware_concurrency());
}

void WorkerPool::take_parts(const Loop& loop) noexcept {
  for (;;) {
    const std::size_t begin = next_.fetch_add(loop.grain, std::memory_order_relaxed);
    if (begin >= loop.count) return;
    loop.call(loop.body, begin, std::min(begin + loop.grain, loop.count));
  }
}

void WorkerPool::run_loop(const Loop& loop) noexcept {
  if (loop.count == 0) return;
  if (loop.count <= loop.grain || threads_.empty()) {
    for (std::size_t begin = 0; begin < loop.count; begin += loop.grain) {
      loop.call(loop.body, begin, std::min(begin + loop.grain, loop.count));
    }
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    next_.store(0, std::memory_order_relaxed);
    loop_ = loop;
    ++number_;
    open_ = true;
  }
  begun_.notify_all();
  take_parts(loop);
  std::unique_lock lock(mutex_);
  open_ = false;
  left_.wait(lock, [this] { return inside_ == 0; });
}

void WorkerPool::work() noexcept {
  unsigned long long done = 0;
  std::unique_lock lock(mutex_);
  for (;;) {
    begun_.wait(lock, [&] { return stop_ || (open_ && number_ != done); });
    if (stop_) return;
    done = number_;
    const Loop loop = loop_;
    ++inside_;
    lock.unlock();
    take_parts(loop);
    lock.lock();
    if (--inside_ == 0) left_.notify_one();
  }
}

}  // namespace emit::renderer
