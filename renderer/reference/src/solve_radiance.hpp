// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <vector>

#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Integral of Planck's law over a band, by Gauss-Legendre panels in wavelength that are cut at the
/// points of the response.
class BandIntegral {
 public:
  explicit BandIntegral(const scene::SpectralBand& band);
  /// Returns the in-band radiance of a blackbody. A temperature of 0 gives 0; a negative one or NaN
  /// gives NaN.
  [[nodiscard]] double radiance_w_m2_sr(double kelvin) const;

 private:
  struct Point {
    double exponent_k = 0.0;  ///< c2 / lambda
    double weight = 0.0;      ///< c1 R / lambda^5 times the weight of the point
  };
  std::vector<Point> points_;
};

/// Radiance that leaves a surface and radiance that arrives at the camera, in one band. The stages
/// are those of the renderer, with the scenario's atmosphere.
class BandRadiance {
 public:
  /// Prepares a band. Errors: config (the band's atmosphere table).
  [[nodiscard]] static physics::Result<BandRadiance> create(const scene::ScenarioDesc& scenario,
                                                            std::size_t band);

  /// Sets the air temperature, the sine of the sun's elevation and the share of the direct sun that
  /// clouds take.
  void set_air(double air_k, double sin_sun, double cloud_frac, bool sun_shines);
  /// Returns the in-band radiance of a blackbody, W m-2 sr-1.
  [[nodiscard]] double black(double kelvin) const { return integral_.radiance_w_m2_sr(kelvin); }
  /// Returns the emissivity of a material in this band.
  [[nodiscard]] double emissivity(const scene::Material& material) const;
  /// Cosine-weighted mean of the sky's radiance, W m-2 sr-1.
  [[nodiscard]] double sky_mean() const noexcept { return sky_mean_; }
  /// Irradiance of the sun in the band, across its direction, W m-2.
  [[nodiscard]] double sun_w_m2() const noexcept { return sun_w_m2_; }
  /// Returns the radiance `leaving` as seen through `range_m` of air, along a line of sight with
  /// this sine of the elevation.
  [[nodiscard]] double at_aperture(double leaving, double range_m, double sin_elevation) const;
  /// Returns the radiance of the sky at a sine of the elevation, W m-2 sr-1.
  [[nodiscard]] double sky(double sin_elevation) const;

 private:
  explicit BandRadiance(const scene::SpectralBand& band) : integral_(band), name_(band.name) {}
  BandIntegral integral_;
  std::string name_;
  std::vector<scene::AtmosphereTerm> terms_;
  double vertical_frac_ = 1.0;
  std::optional<physics::AtmosphereTable> table_;
  double sky_share_ = 0.0;  ///< cosine-weighted mean of 1 - tau^m
  double air_ = 0.0;
  double sky_mean_ = 0.0;
  double sun_w_m2_ = 0.0;
  double sun_black_ = 0.0;
};

}  // namespace emit::reference
