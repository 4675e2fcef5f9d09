// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Physical and geodetic constants in double. The shaders get copies that gl/program.cpp generates
/// from these when it builds a program, so no number is typed twice.
namespace emit::physics {

// These three are exact by the 2019 definition of the SI.
inline constexpr double kPlanckJS = 6.62607015e-34;
inline constexpr double kBoltzmannJPerK = 1.380649e-23;
inline constexpr double kSpeedOfLightMPerS = 299792458.0;

/// Stefan-Boltzmann constant, W m-2 K-4 (CODATA 2018). It follows from the three above: 2 pi^5 k^4
/// / (15 h^3 c^2).
inline constexpr double kStefanBoltzmannWPerM2K4 = 5.670374419e-8;

/// First radiation constant for radiance, 2 h c^2, in W um^4 m-2 sr-1 (wavelength in um).
inline constexpr double kRadianceC1WUm4PerM2Sr =
    2.0 * kPlanckJS * kSpeedOfLightMPerS * kSpeedOfLightMPerS * 1e24;
/// Second radiation constant h c / k in um K.
inline constexpr double kC2UmK = kPlanckJS * kSpeedOfLightMPerS / kBoltzmannJPerK * 1e6;

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kDegree = kPi / 180.0;

/// Zero of the Celsius scale, K. Exact.
inline constexpr double kZeroCelsiusK = 273.15;

/// Mean apparent semi-angle of the sun's disc as seen from the earth.
inline constexpr double kSunSemiAngleRad = 0.2666 * kDegree;
/// Effective temperature of the sun's photosphere, K.
inline constexpr double kSunTemperatureK = 5772.0;
/// Mean extraterrestrial irradiance of the sun, W m-2.
inline constexpr double kSolarConstantWPerM2 = 1361.0;

/// Reference temperature, K. Surface states in float32 are offsets from it, because a float32
/// kelvin near 300 K resolves only 0.03 mK.
inline constexpr double kReferenceK = 295.0;

// WGS-84 ellipsoid.
inline constexpr double kWgs84SemiMajorM = 6378137.0;
inline constexpr double kWgs84Flattening = 1.0 / 298.257223563;

}  // namespace emit::physics
