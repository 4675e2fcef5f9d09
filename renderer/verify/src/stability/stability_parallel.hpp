// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "stability_tally.hpp"

namespace emit::verify {

/// Calls check(row, tallies) for every row of [0, count) on several threads; 0 threads mean one per
/// processor. Each thread has tallies of its own, as many as `total`, which are merged into `total`
/// in a fixed order.
template <class Check>
void check_in_parallel(std::uint32_t count, unsigned threads, std::vector<Tally>& total,
                       const Check& check) {
  if (threads == 0) threads = std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::vector<Tally>> parts(threads, std::vector<Tally>(total.size()));
  const auto work = [&](unsigned part) {
    const auto at = [&](unsigned p) {
      return static_cast<std::uint32_t>(std::uint64_t{count} * p / threads);
    };
    for (std::uint32_t row = at(part); row < at(part + 1); ++row) check(row, parts[part]);
  };
  std::vector<std::thread> others;
  for (unsigned part = 1; part < threads; ++part) others.emplace_back(work, part);
  work(0);
  for (std::thread& thread : others) thread.join();
  for (const auto& part : parts) {
    for (std::size_t i = 0; i < total.size(); ++i) total[i].merge(part[i]);
  }
}

}  // namespace emit::verify
