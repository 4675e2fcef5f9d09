// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/physics/weather.hpp"

/// One sky for heat and picture: the clouds and the warmth of the air that give the long-wave
/// irradiance of the weather (physics.md eq. 40 and 41). Any thread. RT-safe: no allocation.
namespace emit::physics {

/// State of the sky at an instant. Its long-wave irradiance on level ground is that of the clear
/// share plus that of the clouds, which look like blackbodies of one temperature from below.
struct SkyState {
  double cloud_cover_frac = 0.0;  ///< 0..1, the same in all directions
  double cloud_base_m = 0.0;      ///< height of the clouds' base above the ground
  double cloud_k = 0.0;           ///< temperature of the clouds with the air below them
  /// The air of the clear share emits as if it were that much warmer than the weather's at the
  /// ground.
  double warmer_k = 0.0;
};

/// Returns the sky whose long-wave irradiance on level ground is `longwave_down_w_m2` above air of
/// `air_k`. The cover lies between a clear sky (eq. 12 for the dew point) and an overcast one, and
/// is at least `cloud_frac`. Above an overcast sky's irradiance the clouds are warmer; below a
/// clear one's all of the sky is colder. The irradiance is at least 0.
/// @pre air_k > 0
[[nodiscard]] SkyState sky_state(double longwave_down_w_m2, double air_k, double dew_point_k,
                                 double cloud_frac, const CloudBase& base) noexcept;

}  // namespace emit::physics
