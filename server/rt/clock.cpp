// SPDX-License-Identifier: Apache-2.0
#include "rt/clock.hpp"

#include <ctime>

namespace emit::server {
namespace {

std::int64_t read_ns(clockid_t id) noexcept {
  timespec t{};
  clock_gettime(id, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

}  // namespace

std::int64_t SystemClock::tai_ns() const noexcept {
  return read_ns(CLOCK_TAI);
}

std::int64_t SystemClock::monotonic_ns() const noexcept {
  return read_ns(CLOCK_MONOTONIC);
}

std::int64_t SystemClock::tai_from_utc_offset_ns() const noexcept {
  // Whole seconds; the two reads are far less than half a second apart unless the thread was
  // preempted, hence the second look.
  constexpr std::int64_t kSecondNs = 1'000'000'000;
  const std::int64_t before_ns = read_ns(CLOCK_REALTIME);
  const std::int64_t tai = read_ns(CLOCK_TAI);
  const std::int64_t after_ns = read_ns(CLOCK_REALTIME);
  const std::int64_t utc_ns = before_ns + (after_ns - before_ns) / 2;
  const std::int64_t difference_ns = tai - utc_ns;
  return (difference_ns + (difference_ns >= 0 ? kSecondNs / 2 : -kSecondNs / 2)) / kSecondNs *
         kSecondNs;
}

}  // namespace emit::server
