// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>

/// Scattering and phase functions of the aerosols (sun_scatter_tables.cpp).
namespace emit::physics::sun_scatter_tables {

/// Aerosols: rural haze at the humidities of kHazeHumidity, then the tropospheric and the
/// stratospheric one.
inline constexpr std::size_t kAerosols = 6;
inline constexpr std::array<double, 4> kHazeHumidityFrac{0.0, 0.7, 0.8, 0.99};
inline constexpr std::size_t kWavelengths = 26;

/// Returns what the aerosols scatter at a wavelength, by their extinction at 0.55 um: linear
/// between the wavelengths of the table.
[[nodiscard]] std::array<double, kAerosols> scattering(double um) noexcept;

inline constexpr std::size_t kAngles = 34;
inline constexpr std::size_t kPhaseWavelengths = 7;
/// Returns the phase function of an aerosol, sr-1, at a wavelength and a scattering angle of 0 to
/// 180 deg: its logarithm is linear in both between the points of the table.
[[nodiscard]] double phase_per_sr(std::size_t aerosol, double um, double angle_deg) noexcept;

}  // namespace emit::physics::sun_scatter_tables
