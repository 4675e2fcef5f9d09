// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <vector>

#include "emit/physics/air_model.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/sky/fog.hpp"
#include "emit/physics/sky/sun_scatter.hpp"
#include "emit/physics/sky_state.hpp"
#include "emit/physics/sun.hpp"
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

/// Returns the sky that sends a long-wave irradiance on level ground, by bisection over its cover
/// and then over the temperature of its clouds. The renderer's physics::sky_state() has the closed
/// form of the same sky.
[[nodiscard]] physics::SkyState sky_by_bisection(double longwave_down_w_m2, double air_k,
                                                 double dew_point_k, double cloud_frac,
                                                 const physics::CloudBase& base);

/// Returns the sky of a known cover, with clouds at a known height, by bisection over the
/// temperature of its clouds. The renderer's physics::sky_of_cover() has the closed form.
[[nodiscard]] physics::SkyState covered_sky_by_bisection(double longwave_down_w_m2, double air_k,
                                                         double dew_point_k, double cover_frac,
                                                         const physics::CloudBase& base);

/// Sun and temperature at the ground below fog.
struct UnderFog {
  double beam_frac = 1.0;  ///< share of the direct sun above it that is left
  double ground_k = 0.0;   ///< temperature of the ground that lights it
};

/// Radiance that leaves a surface and radiance that arrives at the camera, in one band. The stages
/// are those of the renderer, with the scenario's atmosphere.
class BandRadiance {
 public:
  /// Prepares a band. Errors: config (the band's atmosphere table).
  [[nodiscard]] static physics::Result<BandRadiance> create(const scene::ScenarioDesc& scenario,
                                                            std::size_t band);

  /// Sets the air temperature, the sun, the shares of a clear sky's direct sun that shine below and
  /// above the clouds, and the sky, all of them above the fog.
  void set_air(double air_k, const physics::SunPosition& sun, double beam_frac,
               double beam_above_frac, const physics::SkyState& sky_now,
               const UnderFog& under_fog = {});
  /// Returns the in-band radiance of a blackbody, W m-2 sr-1.
  [[nodiscard]] double black(double kelvin) const { return integral_.radiance_w_m2_sr(kelvin); }
  /// Returns the emissivity of a material in this band.
  [[nodiscard]] double emissivity(const scene::Material& material) const;
  /// Returns the mean of the sky's radiance over the part before a face, weighted with the cosine
  /// to its normal, W m-2 sr-1. `normal_up` is the vertical component of the unit normal.
  [[nodiscard]] double sky_mean(double normal_up) const noexcept;
  /// Returns the radiance of the sun's disc as seen from a height above the world's origin, at a
  /// sine of the elevation, W m-2 sr-1. `beam_frac` is the share of a clear sky's sun that shines.
  [[nodiscard]] double sun_disc(double beam_frac, double sensor_m, double sin_elevation) const;
  /// Returns the radiance of the moon where its ground has a temperature and the sun stands at an
  /// angle from its zenith, W m-2 sr-1.
  [[nodiscard]] double moon(double kelvin, double sun_cosine, double sun_au, double sensor_m,
                            double sin_elevation) const;
  /// Irradiance of the sun in the band, across its direction, W m-2.
  [[nodiscard]] double sun_w_m2() const noexcept { return sun_w_m2_; }
  /// Radiance that leaves a surface, W m-2 sr-1.
  struct Leaving {
    double thermal = 0.0;   ///< emission, and what sky and surroundings send
    double sunlight = 0.0;  ///< reflected
    double surface_k = 0.0;
  };
  /// Returns the radiance of a surface as seen through `range_m` of air, along a line of sight in a
  /// direction (unit vector, ENU) from a height above the world's origin.
  [[nodiscard]] double at_aperture(const Leaving& leaving, double sensor_m, double range_m,
                                   const glm::dvec3& direction) const;
  /// Returns the radiance of the sky in a direction, W m-2 sr-1, from a height above the world's
  /// origin, without the fog before it.
  [[nodiscard]] double sky(double sensor_m, const glm::dvec3& direction) const;
  /// Returns the radiance of sky and clouds in a direction with the fog before them.
  [[nodiscard]] double through_fog(double sky_w_m2_sr, double sensor_m,
                                   const glm::dvec3& direction) const;
  /// Takes the clouds of sky() apart, for the picture: what sky_mean() says stays. sky() is then
  /// that between the clouds.
  void part_clouds() noexcept { parted_ = true; }
  /// Returns the radiance of a cloud at a sine of the elevation, as it looks from a height above
  /// the world's origin below its base: that of the base, through the air, and that of the air.
  [[nodiscard]] double cloud(double sensor_m, double sin_elevation) const;

 private:
  explicit BandRadiance(const scene::SpectralBand& band) : integral_(band), name_(band.name) {}
  BandIntegral integral_;
  std::string name_;
  std::vector<scene::AtmosphereTerm> terms_;
  double vertical_frac_ = 1.0;
  std::optional<physics::AtmosphereTable> table_;
  std::optional<physics::AirColumn> column_;  ///< built-in air, with air_terms_
  std::optional<physics::BandAir> air_terms_;
  std::optional<physics::SunScatter> scatter_;  ///< empty where sunlight hardly counts
  /// Sun of the instant, empty where none is scattered.
  struct Shine {
    physics::SunScatter::Beams beams;
    glm::dvec3 to_sun{0.0};
    double share_frac = 0.0;  ///< by a clear sky's at 1 au, below clouds
    double above_frac = 0.0;  ///< the same above them
  };
  std::optional<Shine> shine_;
  /// Light that a path scatters at the instant, W m-2 by kind, for a sensor at a height.
  [[nodiscard]] physics::SunScatter::Kinds scattered(const physics::AirPath& path,
                                                     double sensor_m) const;
  /// The sky for a phase function of the scattered light.
  [[nodiscard]] double sky(double sensor_m, double sin_elevation,
                           const physics::SunScatter::Kinds& phase_per_sr) const;
  /// Radiance at the aperture as if there were no fog.
  [[nodiscard]] double through_air(const Leaving& leaving, double sensor_m, double range_m,
                                   const glm::dvec3& direction) const;
  /// Part of a line of sight in the fog; none without fog.
  [[nodiscard]] physics::FogStretch<double> in_fog(double sensor_m, double sin_elevation,
                                                   double range_m) const noexcept;
  /// Radiance at the aperture with the fog before it, for one of its extinctions.
  [[nodiscard]] double through_fog(double clear_w_m2_sr, double sensor_m,
                                   const physics::FogStretch<double>& stretch,
                                   double extinction_per_m, const glm::dvec3& direction) const;
  std::optional<physics::Fog> fog_;
  physics::FogOptics fog_optics_;
  physics::FogLight<double> fog_light_;
  double air_k_ = 0.0;
  double place_m_ = 0.0;       ///< height of the world's origin above sea level
  double warmer_k_ = 0.0;      ///< air at sea level against that of the climate
  double sky_warmer_k_ = 0.0;  ///< the same in the sky
  physics::SkyState sky_now_;
  bool has_air_ = false;
  double base_ = 0.0;     ///< radiance of the clouds' base, W m-2 sr-1
  bool parted_ = false;   ///< part_clouds()
  double sky_air_ = 0.0;  ///< blackbody as warm as the air of the sky
  double air_ = 0.0;
  static constexpr std::size_t kTiltSteps = 90;
  std::array<double, kTiltSteps + 1> sky_means_{};  ///< by tilt, every 2 degrees
  /// Transmittance from a height above the world's origin to space.
  [[nodiscard]] double to_space(double sensor_m, double sin_elevation,
                                physics::AirSource source) const;
  double sun_w_m2_ = 0.0;
  double sun_outside_w_m2_ = 0.0;  ///< at 1 au
};

}  // namespace emit::reference
