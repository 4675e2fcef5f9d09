// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/sun.hpp"

/// What drives the surfaces at an instant: from a weather table or from the clear-sky models.
/// Any thread. RT-safe: no allocation.
namespace emit::physics {

/// Weather at one instant of simulation time: a row of a weather table, or what the host sent.
/// A table is linear between its samples and constant outside.
struct WeatherSample {
  std::int64_t sim_time_ns = 0;
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double cloud_frac = 0.0;              ///< beta of Eq. 1 for clear-sky models; 0 for measured sun
  std::optional<double> environment_k;  ///< surroundings; absent: air temperature
  std::optional<double> film_w_m2_k;    ///< absent: from the wind; not used by emit2014
};

/// Parameters of the clear-sky models.
struct ClearSky {
  double linke_turbidity = 3.5;
  double air_mean_k = 290.0;
  double air_amplitude_k = 6.0;  ///< daily, maximum at 15:00 mean local solar time
  double dew_point_k = 282.0;
  double wind_m_s = 2.0;
  double cloud_frac = 0.0;
};

/// Inputs of Eq. 1 that do not depend on the surface.
struct Forcing {
  double direct_normal_w_m2 = 0.0;  ///< before clouds: Eq. 1 applies cloud_frac
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double environment_k = 0.0;
  bool environment_stated = false;  ///< by the weather; otherwise environment_k is that of the air
  double film_w_m2_k = 0.0;
  double wind_m_s = 0.0;
  double cloud_frac = 0.0;
};

/// Linear between rows, constant before the first and after the last. Two rows with one time make
/// a jump: the later row holds from that instant on. An optional value that only one of two
/// neighbours states is replaced by its model at the other.
/// @pre rows is not empty and ascending.
[[nodiscard]] Forcing forcing_from_rows(std::span<const WeatherSample> rows,
                                        std::int64_t sim_time_ns) noexcept;

/// Clear sky at a place and an instant (POSIX ns UTC); `sun` is the sun's position there and then.
[[nodiscard]] Forcing forcing_from_clear_sky(const ClearSky& model, const GeoPlace& place,
                                             const SunPosition& sun,
                                             std::int64_t posix_utc_ns) noexcept;

}  // namespace emit::physics
