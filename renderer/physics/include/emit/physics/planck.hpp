// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/units.hpp"

/// In-band radiance of a blackbody in double: Gauss-Legendre panels in x = c2 / (lambda T), all
/// terms positive, so nothing cancels at either end of the temperature scale (physics.md eq. 7).
/// Any thread after construction. Real time: setup only for validate(); the rest does not
/// allocate, but takes microseconds: pixels use BandRadianceLut.
namespace emit::physics {

/// Relative response at one wavelength.
struct ResponsePoint {
  double wavelength_um = 0.0;
  double response_frac = 0.0;
};

/// Spectral band. Without a response table it is a perfect rectangle over [lo_um, hi_um]; with one,
/// the response is linear between its points and zero outside them and outside [lo_um, hi_um].
struct Band {
  double lo_um = 0.0;
  double hi_um = 0.0;
  std::vector<ResponsePoint> response;
};

/// Checks 0 < lo < hi <= 1000 um, the table strictly ascending, 0..1, at least two points, not zero
/// throughout the band. Errors: invalid_argument naming the point. The functions below need a band
/// that passes.
[[nodiscard]] Result<void> validate(const Band& band);

struct BandRadiance {
  double radiance_w_m2_sr = 0.0;      ///< L; 0 where it underflows double
  double derivative_w_m2_sr_k = 0.0;  ///< dL/dT
  double log_radiance = 0.0;          ///< ln L, finite also where L underflows
};

/// L, dL/dT and ln L at T > 0; T <= 0 gives zeros and -Inf, NaN gives NaN.
/// Accuracy: 1e-13 relative where L is a normal number, checked 3..6000 K.
[[nodiscard]] BandRadiance band_radiance(const Band& band, Kelvin temperature) noexcept;

/// Planck's law at one wavelength, W m-2 sr-1 um-1.
[[nodiscard]] SpectralRadiance spectral_radiance(Micrometres wavelength,
                                                 Kelvin temperature) noexcept;

/// Temperature of the blackbody with this in-band radiance. Empty for a radiance that is not
/// positive and finite, or whose temperature lies outside 2..50000 K.
[[nodiscard]] std::optional<Kelvin> brightness_temperature(const Band& band,
                                                           Radiance radiance) noexcept;

}  // namespace emit::physics
