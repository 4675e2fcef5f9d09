// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "draw/sky_bodies.hpp"
#include "emit/physics/air_view.hpp"
#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/band_radiance_lut.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sky/fog.hpp"
#include "emit/physics/sky/moon.hpp"
#include "emit/physics/sky_state.hpp"
#include "emit/physics/weather.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/band_lights.hpp"
#include "shared/frame_params.glsl.h"
#include "stages/lobe_model.hpp"

namespace emit::renderer {

/// Blackbody tables and atmosphere of the scenario's bands (physics.md sections 5 and 9).
/// Owner: Renderer. Thread: the one of the renderer. Real time: build() and apparent_temperatures()
/// are setup only, the rest is RT-safe.
class BandModel final : public BandLights {
 public:
  /// Builds the tables of all bands and materials. Errors: config (no band or more than
  /// EMIT_MAX_BANDS, a band or an atmosphere that is not valid, tables too large for a device).
  [[nodiscard]] static physics::Result<BandModel> build(const scene::ScenarioDesc& scenario,
                                                        std::span<const scene::Material> materials);

  /// Sets air, surroundings and sun to the instant of the frame. `sensor_m` is the height of the
  /// camera above sea level; `cloud_light` is that of broken clouds, if there are any.
  void update(const physics::Forcing& forcing, const physics::SunPosition& sun,
              const physics::MoonPosition& moon, double sensor_m,
              const physics::CloudLight& cloud_light) noexcept;

  [[nodiscard]] std::size_t bands() const noexcept override { return entries_.size(); }
  void light_at(const physics::Forcing& forcing, const physics::SunPosition& sun,
                std::span<BandLight> out) const noexcept override;
  [[nodiscard]] float black_w_m2_sr(std::size_t band, float temperature_k) const noexcept override {
    return entries_[band].lut.lookup(temperature_k).radiance_w_m2_sr;
  }
  [[nodiscard]] float emissivity_frac(std::uint32_t material,
                                      std::size_t band) const noexcept override {
    return tables_[first_emissivity_ + material * entries_.size() + band];
  }

  /// Air between the camera and a point with its fog, by band.
  struct AirWay {
    double air_frac = 1.0;           ///< transmittance for what a source at the temperature emits
    double air_sun_frac = 1.0;       ///< transmittance for reflected sunlight
    double path_w_m2_sr = 0.0;       ///< thermal
    double scattered_w_m2_sr = 0.0;  ///< sunlight
    double fog_frac = 1.0;           ///< transmittance of the fog, which the others include
  };
  /// Line of sight to a point.
  struct Sight {
    float range_m = 0.0F;
    float sin_elevation = 0.0F;
    float sensor_height_m = 0.0F;  ///< above sea level
    float ray_sun_cosine = 0.0F;   ///< of the angle to the sun
  };
  /// Returns the air on a line of sight to a source of a temperature, at the instant of update().
  [[nodiscard]] AirWay air_way(std::size_t band, const Sight& sight,
                               float temperature_k) const noexcept;

  /// Surface or sky of a pixel, as the radiance pass reads it.
  struct Seen {
    bool surface = false;  ///< false: sky, of which only the elevation counts
    float temperature_k = 0.0F;
    float open_frac = 0.0F;   ///< share of the hemisphere that shows sky
    float sun_cosine = 0.0F;  ///< with the visible share of the sun
    float normal_up = 1.0F;
    std::uint32_t material = 0;
    float range_m = 0.0F;
    float sin_elevation = 0.0F;    ///< of the line of sight
    float sensor_height_m = 0.0F;  ///< above sea level
    float ray_sun_cosine = 0.0F;   ///< of the angle between the line of sight and the sun
    SkyBodies bodies;              ///< of a pixel of the sky
    // Glossy surfaces only: unit vectors, relworld, and FrameView::glint_per_sr.
    glm::vec3 normal{0.0F, 0.0F, 1.0F};
    glm::vec3 to_viewer{0.0F, 0.0F, 1.0F};
    glm::vec3 to_sun{0.0F, 0.0F, 1.0F};
    float glint_per_sr = 0.0F;
    float clutter_sd = 0.0F;           ///< mean of the clutter's field over the pixel
    float clutter_variance_k2 = 0.0F;  ///< of the temperature within the pixel
    float cloud_frac = 0.0F;           ///< opacity of broken clouds in a pixel of the sky
  };
  /// Splits the radiance of a pixel of the instant of update(). `incoming_w_m2_sr` is what arrives
  /// at the surface from everything but the sun. Twin of radiance.comp, in float32 like that.
  [[nodiscard]] RadianceTerms terms(std::size_t band, const Seen& seen,
                                    float incoming_w_m2_sr) const noexcept;

  /// Parameters by band, as the shaders read them.
  [[nodiscard]] std::span<const gpu::BandParams> params() const noexcept { return params_; }
  /// Contents of the table buffer: T ln L tables band by band, then the tables of the air, then the
  /// emissivities.
  [[nodiscard]] std::span<const float> tables() const noexcept { return tables_; }
  /// Number of nodes of the T ln L table of one band.
  [[nodiscard]] std::uint32_t nodes_per_band() const noexcept { return nodes_per_band_; }
  /// Bits of the bands whose air is a sum of exponential terms.
  [[nodiscard]] std::uint32_t air_terms() const noexcept { return air_terms_; }
  /// Bits of the bands with built-in air.
  [[nodiscard]] std::uint32_t air_model() const noexcept { return air_model_; }
  /// Bits of the bands whose built-in air may scatter sunlight.
  [[nodiscard]] std::uint32_t air_sun() const noexcept { return air_sun_; }
  /// The sky as lobes see it, if there are glossy materials (lib/lobe.glsl), then tables of the
  /// built-in air for the camera of the frame, one behind the other (lib/air_view.glsl), then
  /// those of the sunlight that it scatters. One node without either.
  [[nodiscard]] std::span<const physics::AirView::Node> air_nodes() const noexcept {
    return air_nodes_;
  }
  /// The part of air_nodes() that the frame needs: by night it ends before the scattered sunlight.
  [[nodiscard]] std::span<const physics::AirView::Node> air_nodes_now() const noexcept {
    return std::span(air_nodes_).first(sunlit_ ? air_nodes_.size() : first_sun_node_);
  }
  /// True if there is a layer of fog.
  [[nodiscard]] bool fog() const noexcept { return fog_.has_value(); }
  /// Height of the fog's top above the camera of update(), m.
  [[nodiscard]] float fog_above_m() const noexcept { return fog_above_m_; }
  /// Bits of the bands whose air is a table.
  [[nodiscard]] std::uint32_t air_table() const noexcept { return air_table_; }
  /// Largest number of exponential terms of a band.
  [[nodiscard]] std::uint32_t max_terms() const noexcept { return max_terms_; }
  /// Index of the first emissivity in tables(). Emissivities are ordered by material, then by band.
  [[nodiscard]] std::uint32_t first_emissivity() const noexcept { return first_emissivity_; }
  /// Index of the first number of the lobes in tables(); 0 without glossy materials.
  [[nodiscard]] std::uint32_t first_lobe() const noexcept { return first_lobe_; }
  /// True if air_nodes() differ from frame to frame.
  [[nodiscard]] bool air_nodes_change() const noexcept { return air_model_ != 0 || lobes_; }
  /// Index of the first change of an emissivity per standard deviation of the clutter, in the same
  /// order.
  [[nodiscard]] std::uint32_t first_emissivity_sd() const noexcept { return first_emissivity_sd_; }
  /// Inverse of the band radiance, by band. Setup only.
  [[nodiscard]] std::vector<physics::ApparentTemperature> apparent_temperatures() const;

 private:
  /// Constants of one band.
  struct Entry {
    physics::Band band;
    physics::BandRadianceLut lut;
    /// Radiance of the sky by tilt divided by a blackbody at air temperature.
    physics::SkyByTilt sky_frac{};
    double vertical_transmittance_frac = 1.0;
    std::optional<physics::AtmosphereTable> air = std::nullopt;  ///< replaces the terms
    physics::SkyByTilt air_sky_w_m2_sr{};                        ///< of that table
    std::optional<physics::AirView> view = std::nullopt;         ///< built-in air
    double climate_k = 0.0;       ///< air temperature of the climate at the ground of the place
    double sun_outside_w_m2 = 0;  ///< in band, normal to the sun, at 1 au
    bool has_sky = false;         ///< false: a band without air shows no sky
    physics::FogOptics fog = {};
  };
  /// Table of the sunlight that the air of a band scatters; empty where there is none.
  [[nodiscard]] std::span<const physics::AirView::Node> sun_nodes_of(
      std::size_t band) const noexcept;
  /// Table of the built-in air of a band; empty for other air.
  [[nodiscard]] std::span<const physics::AirView::Node> air_nodes_of(
      std::size_t band) const noexcept;
  /// Makes the views of the bands with built-in air.
  [[nodiscard]] physics::Result<void> build_views(const scene::ScenarioDesc& scenario);
  /// Weather of an instant in the terms of the picture.
  struct Instant {
    physics::SkyState sky;
    double air_k = 0.0;
    double environment_k = 0.0;
    double air_mass = 0.0;
    double cloud_frac = 0.0;
    double beam_frac = 0.0;            ///< direct sun on the ground over that of a clear sky
    double beam_above_fog_frac = 0.0;  ///< the same above the fog, if there is any
    double sin_sun = 0.0;
    double sin_shown = 0.0;  ///< of the apparent elevation
    double distance_au = 1.0;
  };
  [[nodiscard]] Instant instant_of(const physics::Forcing& forcing,
                                   const physics::SunPosition& sun) const noexcept;
  /// Air of the place against that of the climate at sea level; 0 without built-in air.
  [[nodiscard]] double warmer_k(const Entry& entry, const Instant& now) const noexcept;
  [[nodiscard]] double sky_warmer_k(const Entry& entry, const Instant& now) const noexcept;
  /// Air on a line of sight as if there were no fog.
  [[nodiscard]] AirWay clear_way(std::size_t band, const Sight& sight,
                                 float temperature_k) const noexcept;
  /// Puts the fog before the radiance of what lies on a line of sight, for one of the extinctions
  /// of FogLight: weakens both radiances, adds its own to the first, and returns its transmittance.
  [[nodiscard]] double put_fog_before(std::size_t band, const Sight& sight, double extinction_per_m,
                                      double& path_w_m2_sr,
                                      double& scattered_w_m2_sr) const noexcept;
  /// Clear sky of a band in a direction from the ground of the place, above the fog.
  [[nodiscard]] double clear_sky_w_m2_sr(const Entry& entry, const Instant& now,
                                         double sin_elevation) const noexcept;
  /// Sky of a band with its clouds above the fog, by elevation from the ground of the place.
  [[nodiscard]] physics::AirView::ByElevation sky_above_fog(std::size_t band,
                                                            const Instant& now) const noexcept;
  /// Light of the fog in a band below such a sky. @pre there is fog
  [[nodiscard]] physics::FogLight<double> fog_light_of(
      std::size_t band, const Instant& now,
      const physics::AirView::ByElevation& above) const noexcept;
  /// Sky in a direction from the ground, with the fog before it.
  [[nodiscard]] double through_fog_w_m2_sr(const physics::FogLight<double>& light,
                                           double above_w_m2_sr,
                                           double sin_elevation) const noexcept;
  /// Transmittance of the air for the direct sun.
  [[nodiscard]] double sun_through_frac(const Entry& entry, const Instant& now) const noexcept;
  /// Direct sun over that of a clear sky, as a camera at a height sees it.
  [[nodiscard]] double shown_beam_frac(const Instant& now, double sensor_m) const noexcept;
  /// Sets the sunlight that the air of a band scatters towards the camera.
  void update_scattered(const Entry& entry, const Instant& now, double sensor_m,
                        std::size_t band) noexcept;
  /// Returns the cover that a camera at a height sees as even: that of clouds with structure is
  /// left to the pixels, and above their base there are none.
  [[nodiscard]] double even_cover_frac(const Entry& entry, const Instant& now,
                                       double sensor_m) const noexcept {
    const bool below = sensor_m < place_m_ + now.sky.cloud_base_m;
    return entry.has_sky && !clouds_ && below ? now.sky.cloud_cover_frac : 0.0;
  }
  /// Returns the radiance of clouds in a band by elevation, as it looks from a height below them:
  /// that of their base, with the air before it (physics.md eq. 84).
  [[nodiscard]] physics::AirView::ByElevation clouds_by_elevation(std::size_t band,
                                                                  const Instant& now,
                                                                  double sensor_m) const noexcept;
  /// Sets the clouds of a band, even or with structure, as the camera sees them.
  void update_clouds(std::size_t band, const Instant& now, double sensor_m) noexcept;
  /// Sets the radiance of the discs of sun and moon in a band.
  void update_bodies(const Entry& entry, const Instant& now, const physics::MoonPosition& moon,
                     double sensor_m, gpu::BandParams& params) const noexcept;
  void light_of(std::size_t band, const Instant& now, BandLight& out) const noexcept;
  /// Sets the sky of a band as lobes see it.
  void update_lobe_sky(std::size_t band, const Instant& now) noexcept;
  std::vector<Entry> entries_;
  std::vector<gpu::BandParams> params_;
  std::vector<float> tables_;
  std::uint32_t nodes_per_band_ = 0;
  std::vector<physics::AirView::Node> air_nodes_;
  std::size_t first_sun_node_ = 0;      ///< of air_nodes_: scattered sunlight begins there
  std::vector<std::size_t> sun_nodes_;  ///< by band: first node, or 0
  bool sunlit_ = false;                 ///< some band has scattered sunlight now
  double place_m_ = 0.0;                ///< height of the world's origin above sea level
  double turbidity_ = 0.0;
  double dew_point_k_ = 0.0;
  physics::CloudBase cloud_base_;
  std::optional<physics::Clouds> clouds_;
  std::optional<physics::Fog> fog_;
  std::optional<physics::FogShade> fog_shade_;
  std::vector<physics::FogLight<double>> fog_lights_;  ///< of the latest update(), by band
  float fog_above_m_ = 0.0F;
  float fog_k_ = 0.0F;
  physics::CloudLight cloud_light_;                         ///< of the latest update()
  std::vector<physics::AirView::ByElevation> cloud_views_;  ///< by band, as params() has them
  std::uint32_t air_model_ = 0;
  std::uint32_t air_sun_ = 0;
  std::uint32_t air_terms_ = 0;
  std::uint32_t air_table_ = 0;
  std::uint32_t max_terms_ = 0;
  std::uint32_t first_emissivity_sd_ = 0;
  std::uint32_t first_emissivity_ = 0;
  std::uint32_t first_lobe_ = 0;
  std::optional<LobeModel> lobes_;  ///< empty without glossy materials
};

/// Returns the transmittance of built-in air on a line of sight for what a source of a temperature
/// emits, from the table of a camera. RT-safe.
/// @pre nodes.size() == physics::AirView::kNodes
[[nodiscard]] double air_transmittance(std::span<const physics::AirView::Node> nodes,
                                       const BandModel::Sight& sight, float temperature_k) noexcept;

/// Materials as the shaders read them. Temperature offsets count from `reference_k`. Setup only.
[[nodiscard]] std::vector<gpu::MaterialParams> material_params(
    std::span<const scene::Material> materials, const scene::ScenarioDesc& scenario,
    double reference_k);

}  // namespace emit::renderer
