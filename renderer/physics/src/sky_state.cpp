// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky_state.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

/// Least share of a clear sky's irradiance that clouds can add, so that their cover has a meaning.
constexpr double kLeastSpanFrac = 1e-6;

}  // namespace

SkyState sky_state(double longwave_down_w_m2, double air_k, double dew_point_k, double cloud_frac,
                   const CloudBase& base) noexcept {
  EMIT_DCHECK(air_k > 0.0);
  const auto irradiance = [&](double cover_frac, const CloudBase& at) {
    return sky_longwave_w_m2(Kelvin(air_k), Kelvin(dew_point_k), cover_frac, at);
  };
  const double wanted = std::max(longwave_down_w_m2, 0.0);
  const double clear = irradiance(0.0, base);
  const double span = irradiance(1.0, base) - clear;
  // Solve eq. 12 for the cover. A saturated sky leaves no room for clouds, unless there is more.
  SkyState state;
  double cover = wanted > clear ? 1.0 : 0.0;
  if (span > kLeastSpanFrac * clear) cover = std::clamp((wanted - clear) / span, 0.0, 1.0);
  cover = std::max(cover, std::clamp(cloud_frac, 0.0, 1.0));
  // The clouds send what the clear share leaves; no cloud is darker than the clear sky.
  const double overcast =
      cover > 0.0 ? std::max((wanted - (1.0 - cover) * clear) / cover, clear) : clear;
  const double reached = (1.0 - cover) * clear + cover * overcast;
  const double ratio = std::pow(std::max(wanted / reached, 1e-8), 0.25);
  state.cloud_cover_frac = cover;
  state.cloud_k = std::pow(overcast / kStefanBoltzmannWPerM2K4, 0.25) * ratio;
  state.warmer_k = air_k * (ratio - 1.0);
  // Find the base that sends it, by eq. 12 again.
  state.cloud_base_m = cloud_base_m(base, air_k);
  const double room = irradiance(1.0, {.kelvin = air_k}) - clear;
  if (!base.height_m && room > kLeastSpanFrac * clear) {
    const double base_k = air_k * std::pow(std::clamp((overcast - clear) / room, 0.0, 1.0), 0.25);
    state.cloud_base_m = std::max(kLowestInferredBaseM, cloud_base_m({.kelvin = base_k}, air_k));
  }
  return state;
}

SkyState sky_of_cover(double longwave_down_w_m2, double air_k, double dew_point_k,
                      double cover_frac, double base_m) noexcept {
  EMIT_DCHECK(air_k > 0.0);
  const double wanted = std::max(longwave_down_w_m2, 0.0);
  const double clear = sky_longwave_w_m2(Kelvin(air_k), Kelvin(dew_point_k), 0.0);
  const double warmest = std::max(kStefanBoltzmannWPerM2K4 * std::pow(air_k, 4.0), clear);
  const double overcast =
      cover_frac > 0.0
          ? std::clamp((wanted - (1.0 - cover_frac) * clear) / cover_frac, clear, warmest)
          : clear;
  const double reached = (1.0 - cover_frac) * clear + cover_frac * overcast;
  const double ratio = std::pow(std::max(wanted / reached, 1e-8), 0.25);
  return {cover_frac, base_m, std::pow(overcast / kStefanBoltzmannWPerM2K4, 0.25) * ratio,
          air_k * (ratio - 1.0)};
}

double tilted_cosine(double normal_up, double sin_elevation) noexcept {
  const double up = normal_up * sin_elevation;
  const double across = std::sqrt(std::max(0.0, 1.0 - normal_up * normal_up)) *
                        std::sqrt(std::max(0.0, 1.0 - sin_elevation * sin_elevation));
  if (up >= across) return up;
  if (up <= -across) return 0.0;
  // The cosine is up + across cos(azimuth), above 0 for azimuths below acos(-up / across).
  return (up * std::acos(-up / across) + std::sqrt(across * across - up * up)) / kPi;
}

}  // namespace emit::physics
