// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <cstddef>

namespace emit::renderer {

/// For set-up: oneTBB allocates (frames have threads::WorkerPool).
/// body(begin, end) over parts of [0, count) of at most `grain`, on all cores. What the caller
/// wrote before is read by the bodies and the other way round, also in the eyes of race detectors,
/// which cannot look into oneTBB. The parts differ from run to run: bodies must not depend on them.
template <class Body>
void run_parallel(std::size_t count, std::size_t grain, const Body& body) {
  std::atomic<unsigned> gate{0};
  gate.store(1, std::memory_order_release);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain),
                    [&gate, &body](const tbb::blocked_range<std::size_t>& part) {
                      (void)gate.load(std::memory_order_acquire);
                      body(part.begin(), part.end());
                      gate.fetch_add(1, std::memory_order_release);
                    });
  (void)gate.load(std::memory_order_acquire);
}

}  // namespace emit::renderer
