// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>

#include "rt/histogram.hpp"

namespace emit::server {

/// Distances of predicted sensor poses from the truth that came later. One thread writes, any
/// reads. Real time: RT-safe.
struct PredictionErrors {
  // A histogram holds 1e-9 of the unit, as it does for seconds: bounds from 1e-5 to 10 m or rad.
  Histogram position;  ///< nm
  Histogram attitude;  ///< nrad
  std::atomic<double> max_position_m{0.0};
  std::atomic<double> max_attitude_rad{0.0};

  void record(double error_m, double error_rad) noexcept {
    position.record(nano(error_m));
    attitude.record(nano(error_rad));
    raise(max_position_m, error_m);
    raise(max_attitude_rad, error_rad);
  }

 private:
  static std::int64_t nano(double value) noexcept {
    constexpr double kMost = 1e9;  // further off than the Earth is wide: all the same
    return static_cast<std::int64_t>((value < kMost ? value : kMost) * 1e9);
  }
  static void raise(std::atomic<double>& max, double value) noexcept {
    if (value > max.load(std::memory_order_relaxed)) max.store(value, std::memory_order_relaxed);
  }
};

}  // namespace emit::server
