// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/clear_sky.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

// The disc is wholly set below this elevation; the air mass formula ends a few degrees lower.
constexpr double kLowestElevationDeg = -2.0;

constexpr double kCloudTerm = 0.784;  // of eq. 12
constexpr double kCloudLapseKPerM = 0.0065;

}  // namespace

double relative_air_mass(Radians elevation) noexcept {
  const double elevation_deg = to_degrees(elevation);
  if (!(elevation_deg >= kLowestElevationDeg)) {
    return 0.0;
  }
  return 1.0 / (std::sin(elevation.value()) + 0.50572 * std::pow(elevation_deg + 6.07995, -1.6364));
}

double pressure_ratio(Metres height) noexcept {
  const double h = std::clamp(height.value(), -500.0, 11000.0);
  return std::pow(1.0 - 2.25577e-5 * h, 5.25588);
}

SolarIrradiance clear_sky_irradiance(const SunPosition& sun, Metres height,
                                     double linke_turbidity) noexcept {
  const double cos_zenith = sun.direction_enu.z;
  if (!(cos_zenith > 0.0)) {
    return {};
  }
  const double extraterrestrial = kSolarConstantWPerM2 / (sun.distance_au * sun.distance_au);
  const double air_mass = relative_air_mass(sun.elevation) * pressure_ratio(height);
  const double h = height.value();
  // Coefficients of Ineichen and Perez for the height of the place.
  const double fh1 = std::exp(-h / 8000.0);
  const double fh2 = std::exp(-h / 1250.0);
  const double cg1 = 5.09e-5 * h + 0.868;
  const double cg2 = 3.92e-5 * h + 0.0387;
  const double tl = linke_turbidity;

  // Global and direct irradiance, physics.md eq. 11.
  const double global =
      cg1 * extraterrestrial * cos_zenith * std::exp(-cg2 * air_mass * (fh1 + fh2 * (tl - 1.0)));
  const double b = 0.664 + 0.163 / fh1;
  const double direct =
      extraterrestrial * std::max(0.0, b * std::exp(-0.09 * air_mass * (tl - 1.0)));
  // Limit the direct irradiance: at low turbidity its fit exceeds what the global irradiance
  // allows.
  const double direct_limit =
      global *
      std::max(0.0, (1.0 - (0.1 - 0.2 * std::exp(-tl)) / (0.1 + 0.882 / fh1)) / cos_zenith);
  SolarIrradiance result;
  result.direct_normal_w_m2 = std::min(direct, direct_limit);
  result.diffuse_horizontal_w_m2 = std::max(0.0, global - result.direct_normal_w_m2 * cos_zenith);
  return result;
}

double beam_share_frac(double direct_normal_w_m2, const SunPosition& sun, Metres height,
                       double linke_turbidity) noexcept {
  const double clear = clear_sky_irradiance(sun, height, linke_turbidity).direct_normal_w_m2;
  return clear < 1.0 ? 0.0 : std::clamp(direct_normal_w_m2 / clear, 0.0, 1.2);
}

Radians apparent_elevation(Radians airless) noexcept {
  const double degree = airless.value() / kDegree;
  if (!(degree > -1.0)) return airless;
  const double minutes = 1.02 / std::tan((degree + 10.3 / (degree + 5.11)) * kDegree);
  return Radians((degree + minutes / 60.0) * kDegree);
}

double sky_emissivity_frac(Kelvin dew_point, double cloud_frac) noexcept {
  const double x = (dew_point.value() - kZeroCelsiusK) / 100.0;
  const double clear = std::min(1.0, 0.758 + x * (0.521 + x * 0.625));
  return clear + kCloudTerm * (1.0 - clear) * std::clamp(cloud_frac, 0.0, 1.0);
}

double cloud_base_k(const CloudBase& base, double air_k) noexcept {
  if (base.kelvin) return *base.kelvin;
  if (base.height_m) return std::max(kColdestCloudK, air_k - kCloudLapseKPerM * *base.height_m);
  return std::pow(kCloudTerm, 0.25) * air_k;
}

double cloud_base_m(const CloudBase& base, double air_k) noexcept {
  if (base.height_m) return *base.height_m;
  return std::max(0.0, (air_k - cloud_base_k(base, air_k)) / kCloudLapseKPerM);
}

double sky_longwave_w_m2(Kelvin air, Kelvin dew_point, double cloud_frac,
                         const CloudBase& base) noexcept {
  const double clear = sky_emissivity_frac(dew_point, 0.0);
  const double cloud = std::pow(cloud_base_k(base, air.value()) / air.value(), 4.0);
  const double emissivity = clear + cloud * (1.0 - clear) * std::clamp(cloud_frac, 0.0, 1.0);
  return emissivity * kStefanBoltzmannWPerM2K4 * std::pow(air.value(), 4.0);
}

Kelvin daily_air_temperature(double solar_hours, Kelvin mean, Kelvin amplitude) noexcept {
  return mean + amplitude * std::cos(2.0 * kPi * (solar_hours - 15.0) / 24.0);
}

double film_coefficient_w_m2_k(double wind_m_s) noexcept {
  return 5.7 + 3.8 * std::max(0.0, wind_m_s);
}

}  // namespace emit::physics
