// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <concepts>
#include <cstddef>

#include "emit/physics/check.hpp"

/// Parallel loops for set-up and for the reference solver. They run on oneTBB's threads and
/// allocate, so work within a frame uses threads::WorkerPool instead.
///
/// Hand-over and completion are visible to race detectors, which cannot look into oneTBB: a body
/// reads what the caller wrote before the loop, and the caller reads what the bodies wrote. oneTBB
/// cuts the range differently in every run, so a result must not depend on the parts.
/// Thread: any.  Real time: not RT-safe.
namespace emit::threads {

/// Calls body(part) for parts of `range` on all cores.
/// @param range        a range of tbb::parallel_for
/// @param partitioner  none, or one of oneTBB's partitioners
template <class Range, class Body, class... Partitioner>
void parallel_ranges(const Range& range, const Body& body, const Partitioner&... partitioner) {
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

/// Calls body(begin, end) for parts of [0, count) that hold at most `grain` indices.
/// @pre grain > 0
template <class Body>
void parallel_parts(std::size_t count, std::size_t grain, const Body& body) {
  EMIT_CHECK_OP(grain, >, 0U);
  parallel_ranges(tbb::blocked_range<std::size_t>(0, count, grain),
                  [&body](const auto& part) { body(part.begin(), part.end()); });
}

/// Calls body(i) for every i of [first, last).
template <std::integral Index, class Body>
void parallel_indices(Index first, Index last, const Body& body) {
  parallel_ranges(tbb::blocked_range<Index>(first, last), [&body](const auto& part) {
    for (Index i = part.begin(); i != part.end(); ++i) body(i);
  });
}

}  // namespace emit::threads
