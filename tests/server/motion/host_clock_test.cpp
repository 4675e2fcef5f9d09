// SPDX-License-Identifier: Apache-2.0
#include "motion/host_clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "support/times.hpp"

namespace emit::server {
namespace {

using test::kMs;
constexpr std::int64_t kStartNs = 1'700'000'000'000'000'000;

TEST(HostClock, jitter_of_the_network_moves_it_little) {
  std::mt19937_64 random(7);
  std::exponential_distribution<double> late_ns(1.0 / 2e6);
  HostClock clock;
  std::int64_t least = INT64_MAX;
  std::int64_t most = INT64_MIN;
  for (int i = 0; i < 10'000; ++i) {
    const std::int64_t sim_ns = i * 10 * kMs;
    const std::int64_t received_ns =
        kStartNs + sim_ns + 3 * kMs + static_cast<std::int64_t>(late_ns(random));
    EXPECT_FALSE(clock.arrived(sim_ns, received_ns));
    if (i < 1000) continue;
    const std::int64_t error_ns = clock.sim_time_ns(kStartNs + sim_ns) - (sim_ns - 3 * kMs);
    least = std::min(least, error_ns);
    most = std::max(most, error_ns);
  }
  // Arrivals are late by 2 ms in the mean and by up to 20 ms; the clock is late by 0.1 ms at most.
  EXPECT_GE(least, -kMs / 5);
  EXPECT_LE(most, kMs / 100);
}

TEST(HostClock, lost_poses_shift_nothing) {
  std::mt19937_64 random(3);
  HostClock clock;
  for (int i = 0; i < 20'000; ++i) {
    if (i > 0 && random() % 2 == 0) continue;
    const std::int64_t sim_ns = i * kMs;
    EXPECT_FALSE(clock.arrived(sim_ns, kStartNs + sim_ns));
    EXPECT_EQ(clock.sim_time_ns(kStartNs + sim_ns), sim_ns);
  }
}

TEST(HostClock, follows_the_drift_of_the_hosts_clock) {
  HostClock clock;
  double worst_ns = 0.0;
  for (int i = 0; i < 60'000; ++i) {
    const std::int64_t sim_ns = i * kMs;
    const std::int64_t received_ns =
        kStartNs + sim_ns + static_cast<std::int64_t>(50e-6 * static_cast<double>(sim_ns));
    EXPECT_FALSE(clock.arrived(sim_ns, received_ns));
    worst_ns =
        std::max(worst_ns, std::abs(static_cast<double>(clock.sim_time_ns(received_ns) - sim_ns)));
  }
  EXPECT_LT(worst_ns, 10e3);  // the window of 64 ms at 50 ppm is 3 us
}

TEST(HostClock, finds_the_least_delay_at_once_in_the_beginning) {
  HostClock clock;
  clock.arrived(0, kStartNs + 9 * kMs);
  clock.arrived(kMs, kStartNs + kMs + 2 * kMs);
  EXPECT_EQ(clock.sim_time_ns(kStartNs + 2 * kMs), 0);
}

TEST(HostClock, a_jump_of_simulation_time_is_reported_and_followed) {
  for (const std::int64_t jump_ns : {1000 * kMs, -1000 * kMs}) {
    HostClock clock;
    for (int i = 0; i < 100; ++i) EXPECT_FALSE(clock.arrived(i * kMs, kStartNs + i * kMs));
    // Time that seems to have stood may be a burst of late poses, for a tenth of a second.
    int jumps = 0;
    std::int64_t late_ns = 0;
    for (int i = 100; i < 300; ++i) {
      const std::int64_t received_ns = kStartNs + i * kMs;
      jumps += clock.arrived(i * kMs + jump_ns, received_ns) ? 1 : 0;
      if (clock.sim_time_ns(received_ns) != i * kMs + jump_ns) late_ns += kMs;
    }
    EXPECT_EQ(jumps, 1) << jump_ns;
    EXPECT_LE(late_ns, jump_ns > 0 ? 0 : 101 * kMs) << jump_ns;
  }
}

TEST(HostClock, poses_that_the_network_held_back_are_no_jump) {
  HostClock clock;
  for (int i = 0; i < 200; ++i) EXPECT_FALSE(clock.arrived(i * kMs, kStartNs + i * kMs));
  // Nothing comes for 80 ms, then all of it at once.
  for (int i = 200; i < 280; ++i) EXPECT_FALSE(clock.arrived(i * kMs, kStartNs + 280 * kMs));
  for (int i = 280; i < 400; ++i) EXPECT_FALSE(clock.arrived(i * kMs, kStartNs + i * kMs));
  EXPECT_NEAR(static_cast<double>(clock.sim_time_ns(kStartNs + 400 * kMs)), 400e6, 50e3);
}

TEST(HostClock, a_host_that_paused_is_found_within_a_tenth_of_a_second) {
  HostClock clock;
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(clock.arrived(10 * i * kMs, kStartNs + 10 * i * kMs));
  int jumps = 0;
  for (int i = 100; i < 130; ++i) {
    jumps += clock.arrived(10 * i * kMs, kStartNs + (10 * i + 150) * kMs) ? 1 : 0;
  }
  EXPECT_EQ(jumps, 1);
  EXPECT_EQ(clock.sim_time_ns(kStartNs + 1450 * kMs), 1300 * kMs);
}

TEST(HostClock, a_simulation_at_half_speed_is_reported) {
  HostClock clock;
  int jumps = 0;
  for (int i = 0; i < 1000; ++i) jumps += clock.arrived(i * kMs / 2, kStartNs + i * kMs) ? 1 : 0;
  EXPECT_GE(jumps, 3);
}

}  // namespace
}  // namespace emit::server
