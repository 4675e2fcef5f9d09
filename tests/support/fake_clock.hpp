// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>

#include "rt/clock.hpp"

namespace emit::test {

/// Clock whose time moves when the test requests it.
class FakeClock final : public server::Clock {
 public:
  explicit FakeClock(std::int64_t start_ns = 1'000'000'000'000) : now_ns_(start_ns) {}

  void advance(std::int64_t by_ns) noexcept { now_ns_.fetch_add(by_ns); }
  void set(std::int64_t now_ns) noexcept { now_ns_.store(now_ns); }
  /// Sets the wall clock as somebody would; no time passes.
  void step_wall(std::int64_t by_ns) noexcept { wall_step_ns_.fetch_add(by_ns); }

  std::int64_t tai_ns() const noexcept override { return now_ns_.load() + wall_step_ns_.load(); }
  std::int64_t monotonic_ns() const noexcept override { return now_ns_.load(); }
  std::int64_t tai_from_utc_offset_ns() const noexcept override { return 37'000'000'000; }
  std::int64_t tai_from_kernel_stamp_ns(std::int64_t /*kernel_utc_ns*/) const noexcept override {
    return tai_ns();
  }

 private:
  std::atomic<std::int64_t> now_ns_;
  std::atomic<std::int64_t> wall_step_ns_{0};
};

}  // namespace emit::test
