// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/sky/fog.hpp"
#include "emit/physics/sun.hpp"

/// Weather that drives the surfaces at an instant. It comes from a weather table or from the
/// clear-sky models. Any thread. RT-safe: no allocation.
namespace emit::physics {

/// Weather at one instant of simulation time: a row of a weather table, or what the host sent.
struct WeatherSample {
  std::int64_t sim_time_ns = 0;
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double cloud_frac = 0.0;              ///< beta of physics.md eq. 1, 0..1; 0 for measured sun
  std::optional<double> environment_k;  ///< surroundings; if absent, the air temperature
  std::optional<double> film_w_m2_k;    ///< if absent, from the wind; not used by emit2014
  /// Direction from which the wind blows, clockwise from north. If absent, all directions count
  /// alike.
  std::optional<double> wind_from_rad = std::nullopt;
  /// Relative humidity over water, 0..1. If absent, with_vapour() says what counts.
  std::optional<double> relative_humidity_frac = std::nullopt;
  /// Rain, see climate/rain.hpp.
  double rain_mm_h = 0.0;
};

/// Parameters of the clear-sky models.
struct ClearSky {
  double linke_turbidity = 3.5;
  double air_mean_k = 290.0;
  double air_amplitude_k = 6.0;  ///< daily amplitude; the maximum is at 15:00 mean local solar time
  double dew_point_k = 282.0;
  double wind_m_s = 2.0;
  double cloud_frac = 0.0;  ///< share of the sky that clouds cover
  /// Share of the direct sun that passes a cloud; 0 for even clouds (sky/cloud_field.hpp).
  double cloud_transmission_frac = 0.0;
  std::optional<double> wind_from_rad;  ///< see WeatherSample
  CloudBase cloud_base = {};            ///< of any weather, not only of these models
  /// Fog over the place. A weather table has the sun and the sky that were measured below it.
  std::optional<FogShade> fog = std::nullopt;
};

/// Inputs of physics.md eq. 1 that do not depend on the surface.
struct Forcing {
  double direct_normal_w_m2 = 0.0;  ///< before clouds, which absorbed_flux_w_m2() applies
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double environment_k = 0.0;
  bool environment_stated = false;  ///< false: environment_k is the air temperature
  /// Film coefficient that the weather states, multiplied by its share, and that share: between a
  /// row that states it and one that does not, the share goes from 1 to 0.
  double stated_film_w_m2_k = 0.0;
  double stated_film_frac = 0.0;
  double wind_m_s = 0.0;
  /// Direction to which the wind blows. It is a unit vector at rows, shorter between rows of
  /// different directions, and 0 if it is not known.
  double wind_to_east = 0.0;
  double wind_to_north = 0.0;
  /// Gusts that convection adds in squares to the wind (gusts.hpp).
  double gust_m_s = 0.0;
  double height_m = 0.0;     ///< of the place
  double film_factor = 1.0;  ///< multiplies the film of every face
  double cloud_frac = 0.0;
  /// Vapour pressure that the weather states, multiplied by its share, and that share: between a
  /// row that states the humidity and one that does not, the share goes from 1 to 0.
  double stated_vapour_pa = 0.0;
  double stated_vapour_frac = 0.0;
  double vapour_pa = 0.0;  ///< of the air, once with_vapour() has set it
};

/// Returns the forcing with its vapour pressure: the stated one, and for the rest that of the dew
/// point `usual_dew_point_k`, as far as the air can hold it.
[[nodiscard]] Forcing with_vapour(Forcing forcing, double usual_dew_point_k) noexcept;

/// Returns the forcing at a time: linear between rows, constant before the first and after the
/// last. Two rows with the same time make a jump, and the later row holds from that instant on. If
/// only one of two neighbours states `environment_k`, the other one takes it from its model. Height
/// and gusts are 0, see at_place(), and so is the vapour pressure, see with_vapour().
/// @pre rows is not empty and ascending in time.
[[nodiscard]] Forcing forcing_from_rows(std::span<const WeatherSample> rows,
                                        std::int64_t sim_time_ns) noexcept;

/// Returns the forcing with the height of the place, and the gusts that its land makes under that
/// sun.
[[nodiscard]] Forcing at_place(Forcing forcing, const GeoPlace& place,
                               const SunPosition& sun) noexcept;

/// Returns the forcing of a clear sky at a place and an instant (POSIX ns UTC), below the fog if
/// there is any. `sun` is the sun's position at that place and instant.
[[nodiscard]] Forcing forcing_from_clear_sky(const ClearSky& model, const GeoPlace& place,
                                             const SunPosition& sun,
                                             std::int64_t posix_utc_ns) noexcept;

}  // namespace emit::physics
