// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/foster.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"

/// Air and deep ground over the year, and the wind that the warm land around a place makes by
/// convection (physics.md section 8, eq. 42 and 43). Any thread. RT-safe.
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

/// Weather that drives the convection over the land around a place.
struct ConvectionDrive {
  double global_sun_w_m2 = 0.0;  ///< on level ground, after clouds
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double pressure_pa = 101'325.0;
};

/// Returns the heat that half-moist, half-dark land gives to the air, W/m2: the scheme of Holtslag
/// and van Ulden (J. Climate Appl. Meteor. 22, 1983). It is below 0 at night. Dry land gives 1.2 to
/// 1.7 times as much and wet land 0.35 to 0.7 times, the more so the warmer the air is.
[[nodiscard]] double land_heat_w_m2(const ConvectionDrive& drive) noexcept;

/// Returns the speed that the gusts of convection add in squares to the mean wind, m/s: 1.2 times
/// the convective velocity of a mixed layer of 1000 m (Beljaars, Quart. J. Roy. Meteor. Soc. 121,
/// 1995). It is 0 while the land is colder than the air. A factor of 2 in the land's heat or in
/// the layer's depth changes it by 26 %.
[[nodiscard]] double convective_gust_m_s(const ConvectionDrive& drive) noexcept;

}  // namespace emit::physics
