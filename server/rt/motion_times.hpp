// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <atomic>
#include <cstdint>

#include "rt/histogram.hpp"

namespace emit::server {

/// Errors in any unit. A histogram holds 1e-9 of the unit, as it does for seconds: its bounds are
/// from 1e-5 to 10 of the unit. One thread writes, any reads. Real time: RT-safe.
struct ErrorHistogram {
  Histogram histogram;
  std::atomic<double> max{0.0};

  void record(double error) noexcept {
    constexpr double kMost = 1e9;
    histogram.record(static_cast<std::int64_t>(std::min(error, kMost) * 1e9));
    if (error > max.load(std::memory_order_relaxed)) max.store(error, std::memory_order_relaxed);
  }
};

/// Times and errors of the loop through a motion simulator.
struct MotionTimes {
  Histogram late;        ///< command after the instant at which it was due
  Histogram age;         ///< measurement to its arrival
  ErrorHistogram error;  ///< measured angle to commanded one, the axis with the largest, rad
  /// Direction in the centre of the image, after its shift, to where measured axes show it, px.
  ErrorHistogram pointing;
};

}  // namespace emit::server
