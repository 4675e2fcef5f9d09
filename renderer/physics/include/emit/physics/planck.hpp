// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/units.hpp"

/// Radiance of a blackbody in a band, in double (physics.md eq. 7). Gauss-Legendre panels run in
/// x = c2 / (lambda T). All terms are positive, so nothing cancels at either end of the temperature
/// scale.
/// Any thread after construction. Real time: validate() is setup only. The rest does not allocate
/// but takes microseconds, so pixels use BandRadianceLut.
namespace emit::physics {

/// Relative response of a sensor at one wavelength, 0..1.
struct ResponsePoint {
  double wavelength_um = 0.0;
  double response_frac = 0.0;
};

/// Spectral band. An empty response table stands for a perfect rectangle over [lo_um, hi_um].
/// Otherwise the response is linear between the points of the table, and zero outside them and
/// outside [lo_um, hi_um].
struct Band {
  double lo_um = 0.0;
  double hi_um = 0.0;
  std::vector<ResponsePoint> response;
};

/// Checks a band: 0 < lo < hi <= 1000 um. A response table must have at least two points, ascend
/// strictly in wavelength, lie in 0..1 and not be zero throughout the band. The functions below
/// need a band that passes.
/// Errors: invalid_argument, naming the point.
[[nodiscard]] Result<void> validate(const Band& band);

/// Returns the response of a band at a wavelength, 0..1.
[[nodiscard]] double response_frac(const Band& band, double wavelength_um) noexcept;

/// Radiance L of a blackbody in a band, and its derivative.
struct BandRadiance {
  double radiance_w_m2_sr = 0.0;      ///< L; 0 where it underflows double
  double derivative_w_m2_sr_k = 0.0;  ///< dL/dT
  double log_radiance = 0.0;          ///< ln L, finite even if L underflows
};

/// Returns L, dL/dT and ln L at a temperature T > 0. T <= 0 gives L = dL/dT = 0 and ln L = -Inf;
/// NaN gives NaN.
/// Accuracy: 1e-13 relative if L is a normal number, checked at 3..6000 K.
[[nodiscard]] BandRadiance band_radiance(const Band& band, Kelvin temperature) noexcept;

/// Returns the spectral radiance of a blackbody by Planck's law at one wavelength, W m-2 sr-1 um-1.
[[nodiscard]] SpectralRadiance spectral_radiance(Micrometres wavelength,
                                                 Kelvin temperature) noexcept;

/// Returns the temperature of the blackbody that has this in-band radiance. The result is empty if
/// the radiance is not positive and finite, or if the temperature is outside 2..50000 K.
[[nodiscard]] std::optional<Kelvin> brightness_temperature(const Band& band,
                                                           Radiance radiance) noexcept;

}  // namespace emit::physics
