// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/weather.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/air_film.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/climate/gusts.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"

namespace emit::physics {
namespace {

/// Sets the direction to which the wind blows.
void set_wind_direction(const std::optional<double>& from_rad, Forcing& f) noexcept {
  if (!from_rad) return;
  f.wind_to_east = -std::sin(*from_rad);
  f.wind_to_north = -std::cos(*from_rad);
}

Forcing forcing_of(const WeatherSample& row) noexcept {
  Forcing f;
  f.direct_normal_w_m2 = row.direct_normal_w_m2;
  f.diffuse_horizontal_w_m2 = row.diffuse_horizontal_w_m2;
  f.longwave_down_w_m2 = row.longwave_down_w_m2;
  f.air_k = row.air_k;
  f.environment_k = row.environment_k.value_or(row.air_k);
  f.environment_stated = row.environment_k.has_value();
  f.stated_film_w_m2_k = row.film_w_m2_k.value_or(0.0);
  f.stated_film_frac = row.film_w_m2_k ? 1.0 : 0.0;
  f.wind_m_s = row.wind_m_s;
  set_wind_direction(row.wind_from_rad, f);
  f.cloud_frac = row.cloud_frac;
  if (row.relative_humidity_frac) {
    f.stated_vapour_pa = *row.relative_humidity_frac * saturation_over_water_pa(row.air_k);
    f.stated_vapour_frac = 1.0;
  }
  return f;
}

}  // namespace

Forcing forcing_from_rows(std::span<const WeatherSample> rows, std::int64_t sim_time_ns) noexcept {
  EMIT_CHECK(!rows.empty());
  EMIT_DCHECK(std::ranges::is_sorted(rows, {}, &WeatherSample::sim_time_ns));
  const auto after = std::upper_bound(
      rows.begin(), rows.end(), sim_time_ns,
      [](std::int64_t t, const WeatherSample& row) { return t < row.sim_time_ns; });
  if (after == rows.begin()) {
    return forcing_of(rows.front());
  }
  const WeatherSample& before = *(after - 1);
  if (after == rows.end()) {
    return forcing_of(before);
  }
  // Interpolate every input linearly between the two rows.
  const Forcing a = forcing_of(before);
  const Forcing b = forcing_of(*after);
  const double s = static_cast<double>(sim_time_ns - before.sim_time_ns) /
                   static_cast<double>(after->sim_time_ns - before.sim_time_ns);
  const auto mix = [s, &a, &b](double Forcing::*member) {
    return a.*member + s * (b.*member - a.*member);
  };
  Forcing f;
  f.direct_normal_w_m2 = mix(&Forcing::direct_normal_w_m2);
  f.diffuse_horizontal_w_m2 = mix(&Forcing::diffuse_horizontal_w_m2);
  f.longwave_down_w_m2 = mix(&Forcing::longwave_down_w_m2);
  f.air_k = mix(&Forcing::air_k);
  f.environment_k = mix(&Forcing::environment_k);
  f.environment_stated = a.environment_stated || b.environment_stated;
  f.stated_film_w_m2_k = mix(&Forcing::stated_film_w_m2_k);
  f.stated_film_frac = mix(&Forcing::stated_film_frac);
  f.wind_m_s = mix(&Forcing::wind_m_s);
  f.wind_to_east = mix(&Forcing::wind_to_east);
  f.wind_to_north = mix(&Forcing::wind_to_north);
  f.cloud_frac = mix(&Forcing::cloud_frac);
  f.stated_vapour_pa = mix(&Forcing::stated_vapour_pa);
  f.stated_vapour_frac = mix(&Forcing::stated_vapour_frac);
  return f;
}

Forcing with_vapour(Forcing forcing, double usual_dew_point_k) noexcept {
  const double usual_pa = saturation_over_water_pa(std::min(usual_dew_point_k, forcing.air_k));
  forcing.vapour_pa = forcing.stated_vapour_pa + (1.0 - forcing.stated_vapour_frac) * usual_pa;
  return forcing;
}

Forcing at_place(Forcing forcing, const GeoPlace& place, const SunPosition& sun) noexcept {
  forcing.height_m = place.height.value();
  const double direct_w_m2 =
      forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac) * std::max(0.0, sun.direction_enu.z);
  forcing.gust_m_s =
      convective_gust_m_s({.global_sun_w_m2 = direct_w_m2 + forcing.diffuse_horizontal_w_m2,
                           .longwave_down_w_m2 = forcing.longwave_down_w_m2,
                           .air_k = forcing.air_k,
                           .pressure_pa = standard_pressure_pa(forcing.height_m)});
  return forcing;
}

namespace {

/// Returns the forcing on the ground below fog (physics.md eq. 94 to 96).
Forcing under_fog(Forcing f, const FogShade& fog, const SunPosition& sun) noexcept {
  const double sine = sun.direction_enu.z;
  f.diffuse_horizontal_w_m2 *= fog_skylight_frac(fog);
  if (sine > 0.0) {
    const double beam_frac = fog_beam_frac(fog, sine);
    f.diffuse_horizontal_w_m2 += std::max(0.0, fog_sunlight_frac(fog, sine) - beam_frac) * sine *
                                 (1.0 - f.cloud_frac) * f.direct_normal_w_m2;
    f.direct_normal_w_m2 *= beam_frac;
  }
  const double through = fog.longwave_through_frac;
  f.longwave_down_w_m2 = through * f.longwave_down_w_m2 +
                         (1.0 - through) * kStefanBoltzmannWPerM2K4 * std::pow(f.air_k, 4.0);
  return f;
}

}  // namespace

Forcing forcing_from_clear_sky(const ClearSky& model, const GeoPlace& place, const SunPosition& sun,
                               std::int64_t posix_utc_ns) noexcept {
  const SolarIrradiance solar = clear_sky_irradiance(sun, place.height, model.linke_turbidity);
  const Kelvin air = daily_air_temperature(mean_solar_hours(posix_utc_ns, place.longitude),
                                           Kelvin(model.air_mean_k), Kelvin(model.air_amplitude_k));
  Forcing f;
  f.direct_normal_w_m2 = solar.direct_normal_w_m2;
  f.diffuse_horizontal_w_m2 = solar.diffuse_horizontal_w_m2;
  f.longwave_down_w_m2 =
      sky_longwave_w_m2(air, Kelvin(model.dew_point_k), model.cloud_frac, model.cloud_base);
  f.air_k = air.value();
  f.environment_k = air.value();
  f.wind_m_s = model.wind_m_s;
  set_wind_direction(model.wind_from_rad, f);
  f.cloud_frac = model.cloud_frac * (1.0 - model.cloud_transmission_frac);
  if (model.fog) f = under_fog(f, *model.fog, sun);
  return with_vapour(at_place(f, place, sun), model.dew_point_k);
}

}  // namespace emit::physics
