// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"

/// Reflectance of smooth surfaces from their complex refractive index (physics.md eq. 70). Any
/// thread; setup only.
namespace emit::physics {

/// Complex refractive index n - i k of a material at one wavelength.
struct OpticalConstants {
  double wavelength_um = 0.0;
  double refractive_index = 1.0;  ///< n, above 0
  double extinction_index = 0.0;  ///< k, not below 0

  [[nodiscard]] bool operator==(const OpticalConstants&) const = default;
};

/// Built-in tables of optical constants.
enum class IndexTable : std::uint8_t {
  none,
  water,         ///< liquid at 25 C, 2 to 50 um: Hale and Querry 1973
  window_glass,  ///< soda-lime silica, 2 to 50 um: Rubin 1985
};
/// Returns a table, ascending in wavelength; empty for `none`.
[[nodiscard]] std::span<const OpticalConstants> optical_constants(IndexTable table) noexcept;

/// Checks a table: at least one entry, wavelengths that ascend strictly from above 0, n above 0 and
/// k at least 0. Errors: invalid_argument, naming the entry.
[[nodiscard]] Result<void> validate(std::span<const OpticalConstants> table);

/// Returns the constants at a wavelength, linear between the entries; the ends are held.
/// @pre the table is valid
[[nodiscard]] OpticalConstants constants_at(std::span<const OpticalConstants> table,
                                            double wavelength_um) noexcept;

/// Returns the share of unpolarised light that a smooth surface reflects, 0..1 (physics.md eq. 70).
/// `cosine` is that of the angle of incidence, 0..1.
[[nodiscard]] double fresnel_reflectance_frac(double refractive_index, double extinction_index,
                                              double cosine) noexcept;

/// Returns the mean reflectance of a smooth surface in a band for light with the spectrum of a
/// blackbody. @pre the table and the band are valid
[[nodiscard]] double band_reflectance_frac(std::span<const OpticalConstants> table,
                                           const Band& band, Kelvin source, double cosine) noexcept;

}  // namespace emit::physics
