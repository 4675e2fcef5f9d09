// SPDX-License-Identifier: Apache-2.0
#include "threads/worker_pool.hpp"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>

#include "emit/physics/check.hpp"

namespace emit::threads {

WorkerPool::WorkerPool(unsigned int threads) : cores_(CoreSet::of(0)) {
  threads_.reserve(threads);
  ids_.reserve(threads);
  try {
    for (unsigned int i = 1; i < threads; ++i) threads_.emplace_back([this] { work(); });
  } catch (const std::system_error&) {
    // The system has no more threads. Results do not depend on their number.
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
  const int cores = CoreSet::of(0).count();
  if (cores > 0) return static_cast<unsigned int>(cores);
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
  EMIT_CHECK_OP(loop.grain, >, 0U);
  if (loop.count == 0) return;
  if (loop.count <= loop.grain || threads_.empty()) {
    for (std::size_t begin = 0; begin < loop.count; begin += loop.grain) {
      loop.call(loop.body, begin, std::min(begin + loop.grain, loop.count));
    }
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    leave_core_to_caller();
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

void WorkerPool::leave_core_to_caller() noexcept {
  const int core = ::sched_getcpu();
  if (threads_.size() >= static_cast<std::size_t>(cores_.count())) return;
  if (core == left_core_ && ids_.size() == placed_) return;
  const CoreSet others = cores_.without(core);
  for (const pid_t id : ids_) others.give_to(id);
  left_core_ = core;
  placed_ = ids_.size();
}

void WorkerPool::work() noexcept {
  unsigned long long done = 0;
  std::unique_lock lock(mutex_);
  ids_.push_back(::gettid());
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

}  // namespace emit::threads
