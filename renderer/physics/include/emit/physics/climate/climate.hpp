// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/foster.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"

/// Air and deep ground over the year (physics.md section 8). Any thread. RT-safe.
namespace emit::physics {

/// Air temperature over the year: mean + amplitude cos(2 pi (day - warmest_day) / 365.2425).
struct AnnualAir {
  double mean_k = 0.0;
  double amplitude_k = 0.0;  ///< not negative
  double warmest_day = 0.0;  ///< days since the begin of the year, 0..365.2425

  /// Returns the temperature on a day of the year, K.
  [[nodiscard]] double at_k(double day) const noexcept;
};

/// Returns the days since the begin of the year (UTC) of an instant, 0..366.
[[nodiscard]] double day_of_year(std::int64_t posix_utc_ns) noexcept;

/// Returns the air over the year at a place without data: rounded means along the parallels of
/// latitude, less 4.5 K per kilometre of height. Eleven typical years between 33 and 71 N differ in
/// the mean by 4.0 K RMS and 7.1 K at most, in the amplitude by 3.4 K and 6.3 K, in the warmest day
/// by 6 days and 19 days. On continents the amplitude is larger, on coasts smaller.
[[nodiscard]] AnnualAir zonal_climate(const GeoPlace& place) noexcept;

/// Returns mean and first harmonic of measured air. `epoch_utc_ns` is the instant of simulation
/// time 0. Nothing is returned unless the rows cover 300 days.
/// @pre rows ascend in time
[[nodiscard]] std::optional<AnnualAir> annual_air_of(std::span<const WeatherSample> rows,
                                                     std::int64_t epoch_utc_ns) noexcept;

/// Returns the temperature of the ground under a stack of layers on a day of the year, K: the
/// annual wave of the air, damped and delayed by every layer's thickness over sqrt(2 a / w), where
/// a is its diffusivity and w the angular frequency of a year.
[[nodiscard]] double ground_k(const AnnualAir& air, std::span<const StackLayer> layers,
                              double day) noexcept;

/// Returns the dew point of air of 60 % relative humidity, K (Magnus formula).
[[nodiscard]] double usual_dew_point_k(double air_k) noexcept;

}  // namespace emit::physics
