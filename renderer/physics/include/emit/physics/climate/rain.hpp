// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/weather.hpp"

/// Rain of weather tables. A row's `rain_mm_h` is the mean rate since the row before, as rain
/// gauges and typical years have it, so that the depth between two rows is exact whatever steps
/// read it. There is no rain before the first row and after the last. A single row holds at all
/// times.
namespace emit::physics {

/// Returns the rate at an instant, mm/h. Thread: any. RT-safe.
/// @pre rows is ascending in time
[[nodiscard]] double rain_rate_mm_h(std::span<const WeatherSample> rows,
                                    std::int64_t sim_time_ns) noexcept;

/// Depth of rain over the time of a table. Thread: any. RT-safe but for the constructor.
class RainDepth {
 public:
  RainDepth() = default;
  /// @pre rows is ascending in time
  explicit RainDepth(std::span<const WeatherSample> rows);

  /// Returns true if the table has no rain.
  [[nodiscard]] bool is_dry() const noexcept { return times_ns_.empty(); }
  /// Returns the depth since the first row, mm. The depth of a single row counts from time 0.
  [[nodiscard]] double at_mm(std::int64_t sim_time_ns) const noexcept;

 private:
  std::vector<std::int64_t> times_ns_;  ///< of the rows; empty: no rain
  std::vector<double> depth_mm_;        ///< at these times
  double single_mm_h_ = 0.0;
};

}  // namespace emit::physics
