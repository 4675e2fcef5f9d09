// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <concepts>

namespace emit::reference {

/// tbb::parallel_for whose hand-over and completion are also visible in this code: what the caller
/// wrote before is read by the body, what the bodies wrote is read by the caller. oneTBB guarantees
/// the same, but inside a library that race detectors cannot look into. Range as for
/// tbb::parallel_for; an optional partitioner goes last.
template <class Range, class Body, class... Partitioner>
void run_parallel(const Range& range, const Body& body, const Partitioner&... partitioner) {
  std::atomic<unsigned> gate{0};
  gate.store(1, std::memory_order_release);
  tbb::parallel_for(
      range,
      [&gate, &body](const Range& part) {
        (void)gate.load(std::memory_order_acquire);
        body(part);
        gate.fetch_add(1, std::memory_order_release);
      },
      partitioner...);
  (void)gate.load(std::memory_order_acquire);
}

/// body(i) for every i of [first, last).
template <std::integral Index, class Body>
void run_parallel(Index first, Index last, const Body& body) {
  run_parallel(tbb::blocked_range<Index>(first, last), [&body](const auto& part) {
    for (Index i = part.begin(); i != part.end(); ++i) body(i);
  });
}

}  // namespace emit::reference
