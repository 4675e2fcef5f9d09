// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/evaporation.hpp"

#include <algorithm>
#include <cmath>

namespace emit::physics {
namespace {

constexpr double kHeatJKgK = 1013.0;    // of moist air, FAO-56
constexpr double kGasJKgK = 287.05;     // of dry air
constexpr double kVapourRatio = 0.622;  // molar mass of water over that of dry air

}  // namespace

double saturation_over_water_pa(double temperature_k) noexcept {
  const double celsius = std::clamp(temperature_k, 180.0, 400.0) - kZeroCelsiusK;
  return 610.8 * std::exp(17.27 * celsius / (celsius + 237.3));
}

double dew_point_k(double vapour_pa) noexcept {
  const double exponent = std::log(vapour_pa / 610.8);
  return kZeroCelsiusK + 237.3 * exponent / (17.27 - exponent);
}

MoistAir moist_air(double air_k, double pressure_pa, double vapour_pa) noexcept {
  const double latent_j_kg = vaporisation_j_kg(air_k);
  return {.vapour_pa = vapour_pa,
          .psychrometric_pa_k = kHeatJKgK * pressure_pa / (kVapourRatio * latent_j_kg),
          .heat_j_m3_k = kHeatJKgK * pressure_pa / (kGasJKgK * air_k)};
}

MoistAir between_airs(const MoistAir& a, const MoistAir& b, double f) noexcept {
  const auto mix = [f](double x, double y) { return x + f * (y - x); };
  return {.vapour_pa = mix(a.vapour_pa, b.vapour_pa),
          .psychrometric_pa_k = mix(a.psychrometric_pa_k, b.psychrometric_pa_k),
          .heat_j_m3_k = mix(a.heat_j_m3_k, b.heat_j_m3_k)};
}

double surface_resistance_s_m(const MoistSurface& surface, double shortwave_w_m2) noexcept {
  const double light_frac = std::clamp(shortwave_w_m2 / kOpenStomataWM2, 0.0, 1.0);
  if (!(surface.resistance_s_m > 0.0) || light_frac == 1.0) {
    // A surface with no resistance by day has no stomata that could close.
    return surface.resistance_s_m;
  }
  const double night_m_s = 1.0 / std::max(surface.night_resistance_s_m, surface.resistance_s_m);
  return 1.0 / (night_m_s + light_frac * (1.0 / surface.resistance_s_m - night_m_s));
}

void add_moisture(const MoistSurface& surface, const MoistAir& air, double shortwave_w_m2,
                  FosterDrive<double>& drive) noexcept {
  // A face that is dry at one end of a step only has the air's vapour at both.
  drive.vapour_pa = air.vapour_pa;
  if (surface.dry()) return;
  drive.evaporation_w_m2_pa =
      evaporation_w_m2_pa(drive.film_w_m2_k, surface.wetness_frac,
                          surface_resistance_s_m(surface, shortwave_w_m2), air, surface.film_frac);
  drive.dew_w_m2_pa = evaporation_w_m2_pa(drive.film_w_m2_k, 1.0, 0.0, air);
}

}  // namespace emit::physics
