// SPDX-License-Identifier: Apache-2.0
// Tests of the cores on which threads run: the helpers within frames and the driver's threads.
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <latch>
#include <string>
#include <thread>
#include <vector>

#include "threads/core_set.hpp"
#include "threads/software_threads.hpp"
#include "threads/worker_pool.hpp"

namespace emit::threads {
namespace {

/// Restricts the calling thread to one core during its lifetime.
class OnCore {
 public:
  OnCore(const CoreSet& all, std::size_t index) : before_(CoreSet::of(0)) {
    all.only(index).give_to(0);
  }
  ~OnCore() { before_.give_to(0); }
  OnCore(const OnCore&) = delete;
  OnCore& operator=(const OnCore&) = delete;

 private:
  CoreSet before_;
};

class Threads : public testing::Test {
 protected:
  void SetUp() override {
    if (all_.count() < 2) GTEST_SKIP() << "one core";
  }
  const CoreSet all_ = CoreSet::of(0);
  const std::size_t cores_ = static_cast<std::size_t>(all_.count());
};

TEST_F(Threads, SetsOfCoresSayWhereAThreadRuns) {
  for (std::size_t i = 0; i < cores_; ++i) {
    const OnCore on(all_, i);
    const CoreSet here = CoreSet::of(0);
    EXPECT_EQ(here, all_.only(i));
    EXPECT_EQ(here.count(), 1);
    const int core = ::sched_getcpu();
    EXPECT_EQ(here.without(core).count(), 0);
    EXPECT_EQ(all_.without(core).count(), all_.count() - 1);
    // An empty set leaves the thread where it is.
    here.without(core).give_to(0);
    EXPECT_EQ(CoreSet::of(0), here);
  }
  EXPECT_EQ(CoreSet::of(0), all_);
  EXPECT_EQ(all_.without(-1), all_);
}

/// Returns the cores of a pool's threads other than the caller.
CoreSet cores_of_helper(WorkerPool& pool) {
  CoreSet cores;
  const auto caller = std::this_thread::get_id();
  std::atomic<int> arrived{0};
  pool.run(2, 1, [&](std::size_t, std::size_t) {
    if (std::this_thread::get_id() != caller) cores = CoreSet::of(0);
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  });
  return cores;
}

TEST_F(Threads, HelpersStayOffTheCallersCore) {
  WorkerPool pool(2);
  for (const std::size_t index : {std::size_t{0}, std::size_t{1}, std::size_t{0}}) {
    const OnCore on(all_, index);
    // All helpers have started at the second call.
    static_cast<void>(cores_of_helper(pool));
    EXPECT_EQ(cores_of_helper(pool), all_.without(::sched_getcpu())) << index;
  }
}

TEST_F(Threads, HelpersThatOutnumberTheCoresRunAnywhere) {
  WorkerPool pool(static_cast<unsigned int>(cores_) + 1);
  const OnCore on(all_, 0);
  for (int round = 0; round < 20; ++round) EXPECT_TRUE(cores_of_helper(pool) == all_);
}

/// Threads as Mesa starts them. Those that draw take their names later, as does one that does
/// something else, and nothing waits for that. Those that compute have no name.
class DriverThreads {
 public:
  DriverThreads(std::size_t raster, std::size_t compute)
      : started_(static_cast<std::ptrdiff_t>(raster + 1 + compute)),
        raster_(raster),
        compute_(compute) {
    const SoftwareThreads::Naming naming;
    for (std::size_t i = 0; i < raster; ++i) {
      threads_.emplace_back([this, i] {
        raster_[i] = ::gettid();
        started_.count_down();
        ::pthread_setname_np(::pthread_self(), ("llvmpipe-" + std::to_string(i)).c_str());
        ended_.wait();
      });
    }
    threads_.emplace_back([this] {
      started_.count_down();
      ::pthread_setname_np(::pthread_self(), "disk$0");
      ended_.wait();
    });
    for (std::size_t i = 0; i < compute; ++i) {
      threads_.emplace_back([this, i] {
        compute_[i] = ::gettid();
        started_.count_down();
        ended_.wait();
      });
    }
    started_.wait();
  }
  ~DriverThreads() {
    ended_.count_down();
    for (std::thread& thread : threads_) thread.join();
  }
  DriverThreads(const DriverThreads&) = delete;
  DriverThreads& operator=(const DriverThreads&) = delete;

  [[nodiscard]] const std::vector<pid_t>& raster() const { return raster_; }
  [[nodiscard]] std::vector<pid_t> compute() const {
    std::vector<pid_t> sorted = compute_;
    std::ranges::sort(sorted);
    return sorted;
  }

 private:
  std::latch started_;
  std::latch ended_{1};
  std::vector<pid_t> raster_;
  std::vector<pid_t> compute_;
  std::vector<std::thread> threads_;
};

std::string own_name() {
  char name[16] = {};
  ::pthread_getname_np(::pthread_self(), name, sizeof name);
  return name;
}

TEST_F(Threads, TheDriversThreadsAreFoundAndSpread) {
  const std::string name = own_name();
  const DriverThreads driver(cores_, cores_);
  EXPECT_EQ(own_name(), name);
  const SoftwareThreads found = SoftwareThreads::find();
  EXPECT_EQ(found.raster(), driver.raster());
  EXPECT_EQ(found.compute(), driver.compute());
  for (std::size_t i = 0; i < cores_; ++i) {
    EXPECT_EQ(CoreSet::of(found.compute()[i]), all_.only(i));
  }
  const OnCore on(all_, 1);
  found.leave_core_to_caller();
  for (const pid_t thread : found.raster()) {
    EXPECT_EQ(CoreSet::of(thread), all_.without(::sched_getcpu()));
  }
  found.spread();
  for (std::size_t i = 0; i < cores_; ++i) {
    EXPECT_EQ(CoreSet::of(found.raster()[i]), all_.only(i));
  }
}

TEST_F(Threads, ADriverWithAnotherNumberOfThreadsIsLeftAlone) {
  const DriverThreads driver(cores_ - 1, cores_ - 1);
  const SoftwareThreads found = SoftwareThreads::find();
  EXPECT_TRUE(found.raster().empty());
  EXPECT_TRUE(found.compute().empty());
  found.leave_core_to_caller();
  found.spread();
  for (const auto& threads : {driver.raster(), driver.compute()}) {
    for (const pid_t thread : threads) EXPECT_EQ(CoreSet::of(thread), all_);
  }
}

TEST(ThreadsContract, CoresAndPartsMustExist) {
  const CoreSet all = CoreSet::of(0);
  EXPECT_DEATH(static_cast<void>(all.only(static_cast<std::size_t>(all.count()))), "index <");
  WorkerPool pool(1);
  EXPECT_DEATH(pool.run(10, 0, [](std::size_t, std::size_t) {}), "loop.grain > 0U");
}

}  // namespace
}  // namespace emit::threads
