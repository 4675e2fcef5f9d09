// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <vector>

#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Planck's law over a band: Gauss-Legendre panels in wavelength, cut at the response's points.
class BandIntegral {
 public:
  explicit BandIntegral(const scene::SpectralBand& band);
  [[nodiscard]] double radiance_w_m2_sr(double kelvin) const;

 private:
  struct Point {
    double exponent_k = 0.0;  ///< c2 / lambda
    double weight = 0.0;      ///< c1 R / lambda^5 times the width
  };
  std::vector<Point> points_;
};

/// What leaves a surface and what arrives at the camera, in one band (pipeline as in the renderer,
/// physics of the scenario's atmosphere).
class BandRadiance {
 public:
  /// Errors: config (the band's atmosphere table).
  [[nodiscard]] static physics::Result<BandRadiance> create(const scene::ScenarioDesc& scenario,
                                                            std::size_t band);

  void set_air(double air_k, double sin_sun, double cloud_frac, bool sun_shines);
  [[nodiscard]] double black(double kelvin) const { return integral_.radiance_w_m2_sr(kelvin); }
  [[nodiscard]] double emissivity(const scene::Material& material) const;
  /// Cosine-weighted mean over the sky.
  [[nodiscard]] double sky_mean() const noexcept { return sky_mean_; }
  [[nodiscard]] double sun_w_m2() const noexcept { return sun_w_m2_; }
  /// `leaving` seen through `range_m` of air along a line of sight with that sine of elevation.
  [[nodiscard]] double at_aperture(double leaving, double range_m, double sin_elevation) const;
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
