// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky_state.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::physics {

SkyState sky_state(double longwave_down_w_m2, double air_k, double dew_point_k,
                   const CloudBase& base) noexcept {
  EMIT_DCHECK(air_k > 0.0);
  SkyState state;
  state.cloud_base_k = cloud_base_k(base, air_k);
  state.cloud_base_m = cloud_base_m(base, air_k);
  const auto irradiance = [&](double cover_frac) {
    return sky_longwave_w_m2(Kelvin(air_k), Kelvin(dew_point_k), cover_frac, base);
  };
  // Solve eq. 12 for the cover. A saturated sky leaves no room for clouds.
  const double clear = irradiance(0.0);
  const double span = irradiance(1.0) - clear;
  const double wanted = std::max(longwave_down_w_m2, 0.0);
  if (span > 1e-6 * clear) {
    state.cloud_cover_frac = std::clamp((wanted - clear) / span, 0.0, 1.0);
  }
  // An irradiance goes with the fourth power of the temperature.
  const double reached = clear + span * state.cloud_cover_frac;
  state.warmer_k = air_k * (std::pow(std::max(wanted / reached, 1e-8), 0.25) - 1.0);
  return state;
}

}  // namespace emit::physics
