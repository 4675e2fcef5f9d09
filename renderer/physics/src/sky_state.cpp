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

/// Irradiance of clouds that would cover all of the sky, and the warmth of all of the sky that is
/// left for it.
struct Overcast {
  double irradiance_w_m2 = 0.0;
  double ratio = 1.0;  ///< of temperatures
};

/// The clouds send what the clear share leaves: no cloud is darker than the clear sky, and none is
/// warmer than the air at the ground. What is left warms or cools all of the sky.
Overcast overcast_of(double wanted_w_m2, double clear_w_m2, double air_k, double cover) noexcept {
  const double warmest = std::max(kStefanBoltzmannWPerM2K4 * std::pow(air_k, 4.0), clear_w_m2);
  Overcast out;
  out.irradiance_w_m2 = cover > 0.0 ? std::clamp((wanted_w_m2 - (1.0 - cover) * clear_w_m2) / cover,
                                                 clear_w_m2, warmest)
                                    : clear_w_m2;
  const double reached = (1.0 - cover) * clear_w_m2 + cover * out.irradiance_w_m2;
  out.ratio = std::pow(std::max(wanted_w_m2 / reached, 1e-8), 0.25);
  return out;
}

/// Returns the sky of such clouds, whose base is the stated one.
SkyState covered(const Overcast& sent, double air_k, double cover, const CloudBase& base) noexcept {
  return {.cloud_cover_frac = cover,
          .cloud_base_m = cloud_base_m(base, air_k),
          .cloud_k = std::pow(sent.irradiance_w_m2 / kStefanBoltzmannWPerM2K4, 0.25) * sent.ratio,
          .cloud_base_k = cloud_base_k(base, air_k) * sent.ratio,
          .warmer_k = air_k * (sent.ratio - 1.0)};
}

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
  double cover = wanted > clear ? 1.0 : 0.0;
  if (span > kLeastSpanFrac * clear) cover = std::clamp((wanted - clear) / span, 0.0, 1.0);
  cover = std::max(cover, std::clamp(cloud_frac, 0.0, 1.0));
  const Overcast sent = overcast_of(wanted, clear, air_k, cover);
  SkyState state = covered(sent, air_k, cover, base);
  // Find the base that sends it, by eq. 12 again.
  const double room = irradiance(1.0, {.kelvin = air_k}) - clear;
  if (!base.height_m && room > kLeastSpanFrac * clear) {
    const double fourth = std::clamp((sent.irradiance_w_m2 - clear) / room, 0.0, 1.0);
    const double base_k = std::max(air_k * std::pow(fourth, 0.25), kColdestCloudK);
    state.cloud_base_m = std::max(kLowestInferredBaseM, cloud_base_m({.kelvin = base_k}, air_k));
    state.cloud_base_k = base_k * sent.ratio;
  }
  return state;
}

SkyState sky_of_cover(double longwave_down_w_m2, double air_k, double dew_point_k,
                      double cover_frac, const CloudBase& base) noexcept {
  EMIT_DCHECK(air_k > 0.0 && base.height_m);
  const double clear = sky_longwave_w_m2(Kelvin(air_k), Kelvin(dew_point_k), 0.0);
  return covered(overcast_of(std::max(longwave_down_w_m2, 0.0), clear, air_k, cover_frac), air_k,
                 cover_frac, base);
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
