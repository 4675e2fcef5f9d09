// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Wind that the warm land around a place makes by convection (physics.md section 8, eq. 42 and
/// 43). Raw SI numbers. Any thread. RT-safe.
namespace emit::physics {

/// Weather that drives the convection over the land around a place.
struct ConvectionDrive {
  double global_sun_w_m2 = 0.0;  ///< on level ground, after clouds
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double pressure_pa = 101'325.0;
};

/// Returns the heat that half-moist, half-dark land gives to the air, W/m2: the scheme of Holtslag
/// and van Ulden (J. Climate Appl. Meteor. 22, 1983). It is below 0 at night. Dry land gives 1.2 to
/// 1.7 times as much and wet land 0.35 to 0.7 times, the more so the warmer the air is.
[[nodiscard]] double land_heat_w_m2(const ConvectionDrive& drive) noexcept;

/// Returns the speed that the gusts of convection add in squares to the mean wind, m/s: 1.2 times
/// the convective velocity of a mixed layer of 1000 m (Beljaars, Quart. J. Roy. Meteor. Soc. 121,
/// 1995). It is 0 while the land is colder than the air. A factor of 2 in the land's heat or in
/// the layer's depth changes it by 26 %.
[[nodiscard]] double convective_gust_m_s(const ConvectionDrive& drive) noexcept;

}  // namespace emit::physics
