// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "emit/physics/constants.hpp"
#include "emit/physics/weather.hpp"

/// One sky for heat and picture: the clouds and the warmth of the air that give the long-wave
/// irradiance of the weather (physics.md eq. 40 and 41). Any thread. RT-safe: no allocation.
namespace emit::physics {

/// State of the sky at an instant. Its long-wave irradiance on level ground is that of the clear
/// share plus that of the clouds, which look like blackbodies of one temperature from below.
struct SkyState {
  double cloud_cover_frac = 0.0;  ///< 0..1, the same in all directions
  double cloud_base_m = 0.0;      ///< height of the clouds' base above the ground
  /// Temperature of the clouds with the air below them, over all wavelengths.
  double cloud_k = 0.0;
  double cloud_base_k = 0.0;  ///< temperature of the clouds' base itself
  /// The air of the clear share emits as if it were that much warmer than the weather's at the
  /// ground.
  double warmer_k = 0.0;
};

/// Returns the sky whose long-wave irradiance on level ground is `longwave_down_w_m2` above air of
/// `air_k`. The cover lies between a clear sky (eq. 12 for the dew point) and an overcast one, and
/// is at least `cloud_frac`. Above an overcast sky's irradiance the clouds are warmer, up to the
/// air at the ground, then all of the sky; below a clear one's all of the sky is colder. A base of
/// a stated height keeps its temperature; otherwise it is as high and as warm as eq. 12 says. The
/// irradiance is at least 0.
/// @pre air_k > 0
[[nodiscard]] SkyState sky_state(double longwave_down_w_m2, double air_k, double dew_point_k,
                                 double cloud_frac, const CloudBase& base) noexcept;
/// Returns the same for a cover that is known and clouds at a stated height: over all wavelengths
/// they look as warm as the irradiance asks for, between the clear sky and the air at the ground,
/// and what is left warms or cools all of the sky.
/// @pre air_k > 0, cover_frac is 0..1, and `base` has a height.
[[nodiscard]] SkyState sky_of_cover(double longwave_down_w_m2, double air_k, double dew_point_k,
                                    double cover_frac, const CloudBase& base) noexcept;

/// Mean radiance of the sky as a face sees it, by the tilt of the face: weighted with the cosine to
/// its normal, over that part of the sky that lies before it (physics.md eq. 44). Node i holds
/// faces whose unit normal has the vertical component sky_tilt_normal_up(i), from up to down.
inline constexpr std::size_t kSkyTilts = 17;
using SkyByTilt = std::array<double, kSkyTilts>;
/// Returns the vertical component of the normal at a node, 1 to -1. Nodes are uniform in the tilt.
[[nodiscard]] inline double sky_tilt_normal_up(std::size_t node) noexcept {
  return std::cos(kPi * static_cast<double>(node) / (kSkyTilts - 1));
}
/// Returns the mean over all azimuths of the cosine, not below 0, between a face's normal with that
/// vertical component and directions of that sine of the elevation.
[[nodiscard]] double tilted_cosine(double normal_up, double sin_elevation) noexcept;
/// Returns the sky by tilt for a radiance `sky(sin_elevation)` that is the same all around. A face
/// that looks straight down sees the horizon.
template <class Sky>
[[nodiscard]] SkyByTilt sky_by_tilt(const Sky& sky) {
  constexpr int kRings = 1024;
  SkyByTilt out{};
  SkyByTilt weight{};
  for (int i = 0; i < kRings; ++i) {
    const double sine = (i + 0.5) / kRings;
    const double radiance = sky(sine);
    for (std::size_t t = 0; t < kSkyTilts; ++t) {
      const double cosine = tilted_cosine(sky_tilt_normal_up(t), sine);
      out[t] += cosine * radiance;
      weight[t] += cosine;
    }
  }
  for (std::size_t t = 0; t + 1 < kSkyTilts; ++t) out[t] /= weight[t];
  out[kSkyTilts - 1] = sky(0.0);
  return out;
}
/// Returns the sky of a face between the nodes, linear in the tilt.
template <class Nodes>
[[nodiscard]] auto sky_at_tilt(const Nodes& nodes, double normal_up) noexcept {
  using Value = std::remove_cvref_t<decltype(nodes[0])>;
  const double place = (kSkyTilts - 1) * std::acos(std::clamp(normal_up, -1.0, 1.0)) / kPi;
  const auto node = std::min(static_cast<std::size_t>(place), kSkyTilts - 2);
  const auto f = static_cast<Value>(place - static_cast<double>(node));
  return nodes[node] + f * (nodes[node + 1] - nodes[node]);
}

}  // namespace emit::physics
