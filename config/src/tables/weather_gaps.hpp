// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/weather.hpp"

/// Gaps of a weather table. Setup only; any thread.
namespace emit::config {

/// Returns the median of the pauses between rows, ns. @pre two rows or more
[[nodiscard]] std::int64_t usual_spacing_ns(std::span<const physics::WeatherSample> rows);

/// Returns the rows before which rows are missing: from `from_ns` on, after a pause of half an hour
/// or more that is 2.5 times longer than usual in the table and around it. Nothing is missing where
/// the weather is the same on both sides.
[[nodiscard]] std::vector<std::size_t> weather_gaps(std::span<const physics::WeatherSample> rows,
                                                    std::int64_t from_ns);

}  // namespace emit::config
