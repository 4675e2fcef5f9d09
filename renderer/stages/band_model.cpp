// SPDX-License-Identifier: Apache-2.0
#include "stages/band_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/band_radiance_lut.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/climate/climate.hpp"
#include "emit/physics/sky_state.hpp"
#include "emit/scene/base.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Number of texels that every OpenGL 4.5 device takes in a buffer texture
/// (GL_MAX_TEXTURE_BUFFER_SIZE).
constexpr std::size_t kMaxTableFloats = 65536;
static_assert(kMostBands == EMIT_MAX_BANDS);
static_assert(physics::kSkyTilts == EMIT_SKY_TILTS);
static_assert(physics::AirView::kElevations == 4 * EMIT_SKY_ELEVATION_VEC4);

/// Radiance of the sky by tilt over that of a blackbody, 1 - tau^m(elevation).
physics::SkyByTilt sky_frac(double vertical_transmittance_frac) {
  return physics::sky_by_tilt([&](double sin_elevation) {
    const double mass = physics::relative_air_mass(physics::Radians(std::asin(sin_elevation)));
    return 1.0 - std::pow(vertical_transmittance_frac, mass);
  });
}

/// Atmosphere of a band; null where the scenario has none.
const scene::BandAtmosphere* atmosphere_of(const scene::ScenarioDesc& scenario,
                                           const std::string& band) {
  if (!scenario.atmosphere.enabled) return nullptr;
  for (const scene::BandAtmosphere& entry : scenario.atmosphere.bands) {
    if (entry.band == band) return &entry;
  }
  return nullptr;
}

/// Emissivity of a material in a band.
double band_emissivity_frac(const scene::Material& material, const std::string& band) {
  for (const scene::BandEmissivity& entry : material.band_emissivity) {
    if (entry.band == band) return entry.emissivity_frac;
  }
  return material.emissivity_frac;
}

/// Returns c of L'' / L' = c / T^2 - 2 / T, for a blackbody at 300 K. For a narrow band where
/// exp(c / T) is large, c is the second radiation constant over the wavelength (physics.md eq. 58).
float curvature_k(const physics::BandRadianceLut& lut) {
  constexpr double kAtK = 300.0;
  constexpr double kStepK = 8.0;
  const auto at = [&](double kelvin) {
    return static_cast<double>(lut.lookup(static_cast<float>(kelvin)).radiance_w_m2_sr);
  };
  const double slope = (at(kAtK + kStepK) - at(kAtK - kStepK)) / (2.0 * kStepK);
  const double bend = (at(kAtK + kStepK) - 2.0 * at(kAtK) + at(kAtK - kStepK)) / (kStepK * kStepK);
  return static_cast<float>(kAtK * kAtK * (bend / slope + 2.0 / kAtK));
}

/// Sunlight in a band outside the atmosphere, normal to the sun at 1 au, W m-2: that of the air
/// model's spectrum, or of a blackbody of the sun's disc where the model does not reach.
double sun_outside_w_m2(const physics::Band& band) {
  if (const auto air = physics::BandAir::build(band)) return air->sun_outside_w_m2();
  return physics::band_radiance(band, physics::Kelvin(physics::kSunTemperatureK)).radiance_w_m2_sr *
         physics::kPi * std::pow(std::sin(physics::kSunSemiAngleRad), 2);
}

}  // namespace

physics::Result<void> BandModel::build_views(const scene::ScenarioDesc& scenario) {
  // The sky as lobes see it comes first.
  if (lobes_) air_nodes_.resize(LobeModel::kSkyTable);
  // Bands of one atmosphere share its paths.
  for (std::size_t first = 0; first < entries_.size(); ++first) {
    if ((air_model_ >> first & 1U) == 0 || entries_[first].view) continue;
    const physics::AirSpec spec = *atmosphere_of(scenario, scenario.bands[first].name)->model;
    const auto column = physics::AirColumn::build(spec);
    if (!column) {
      return make_error(ErrorCode::config, fmt::format("band '{}': {}", scenario.bands[first].name,
                                                       column.error().text));
    }
    std::vector<std::size_t> members;
    std::vector<physics::BandAir> bands;
    std::vector<std::optional<physics::SunScatter>> scatters;
    for (std::size_t i = first; i < entries_.size(); ++i) {
      if ((air_model_ >> i & 1U) == 0) continue;
      if (*atmosphere_of(scenario, scenario.bands[i].name)->model != spec) continue;
      auto band = physics::BandAir::build(entries_[i].band);
      if (!band) {
        return make_error(ErrorCode::config,
                          fmt::format("band '{}': {}", scenario.bands[i].name, band.error().text));
      }
      members.push_back(i);
      bands.push_back(std::move(*band));
      scatters.push_back(physics::SunScatter::build(*column, entries_[i].band));
    }
    std::vector<physics::AirView::Subject> subjects;
    for (std::size_t k = 0; k < members.size(); ++k) {
      subjects.push_back({.band = &bands[k], .scatter = scatters[k] ? &*scatters[k] : nullptr});
    }
    std::vector<physics::AirView> views = physics::AirView::build(*column, subjects);
    for (std::size_t k = 0; k < members.size(); ++k) {
      Entry& entry = entries_[members[k]];
      entry.view = std::move(views[k]);
      entry.climate_k = column->at(place_m_).kelvin;
      params_[members[k]].air_view_first = static_cast<std::uint32_t>(air_nodes_.size());
      air_nodes_.resize(air_nodes_.size() + physics::AirView::kNodes);
    }
  }
  if (air_nodes_.empty()) air_nodes_.resize(1);
  // The tables of scattered sunlight come last, because no night needs them.
  first_sun_node_ = air_nodes_.size();
  sun_nodes_.assign(entries_.size(), 0);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (!entries_[i].view || !entries_[i].view->scatters()) continue;
    air_sun_ |= 1U << i;
    sun_nodes_[i] = air_nodes_.size();
    air_nodes_.resize(air_nodes_.size() + physics::AirView::kSunNodes);
  }
  return {};
}

physics::Result<BandModel> BandModel::build(const scene::ScenarioDesc& scenario,
                                            std::span<const scene::Material> materials) {
  if (scenario.bands.empty() || scenario.bands.size() > EMIT_MAX_BANDS) {
    return make_error(ErrorCode::config, fmt::format("{} bands: 1 to {} are possible",
                                                     scenario.bands.size(), EMIT_MAX_BANDS));
  }
  // Set up each band: its T ln L table, then the air as a table or as a sum of terms.
  BandModel model;
  for (const scene::SpectralBand& desc : scenario.bands) {
    const physics::Band spectral = scene::spectral_band(desc);
    const auto lut = physics::BandRadianceLut::build(spectral);
    if (!lut) {
      return make_error(ErrorCode::config,
                        fmt::format("band '{}': {}", desc.name, lut.error().text));
    }
    Entry entry{.band = spectral, .lut = *lut};
    gpu::BandParams params{};
    const auto layout = lut->shader_layout(0);
    params.lut_first_k = layout[0];
    params.lut_nodes_per_k = layout[1];
    params.lut_last_node = layout[2];
    params.vertical_transmittance_frac = 1.0F;
    // Read the atmosphere.
    const scene::BandAtmosphere* atmosphere = atmosphere_of(scenario, desc.name);
    if (atmosphere != nullptr && atmosphere->model) {
      model.air_model_ |= 1U << model.params_.size();
    } else if (atmosphere != nullptr && !atmosphere->table.empty()) {
      auto air = physics::AtmosphereTable::build(atmosphere->table);
      if (!air) {
        return make_error(ErrorCode::config,
                          fmt::format("band '{}': {}", desc.name, air.error().text));
      }
      model.air_table_ |= 1U << model.params_.size();
      entry.air_sky_w_m2_sr =
          physics::sky_by_tilt([&](double sine) { return air->out(sine).path_radiance_w_m2_sr; });
      entry.air = std::move(*air);
    } else if (atmosphere != nullptr) {
      if (atmosphere->terms.size() > EMIT_MAX_ATMOSPHERE_TERMS) {
        return make_error(
            ErrorCode::config,
            fmt::format("atmosphere of band '{}': {} terms, {} are possible", desc.name,
                        atmosphere->terms.size(), EMIT_MAX_ATMOSPHERE_TERMS));
      }
      model.max_terms_ =
          std::max(model.max_terms_, static_cast<std::uint32_t>(atmosphere->terms.size()));
      model.air_terms_ |= 1U << model.params_.size();
      params.terms_amplitude_frac = glm::vec4(0.0F);
      for (std::size_t i = 0; i < atmosphere->terms.size(); ++i) {
        const auto k = static_cast<glm::length_t>(i);
        params.terms_amplitude_frac[k] = static_cast<float>(atmosphere->terms[i].amplitude_frac);
        params.terms_extinction_per_m[k] =
            static_cast<float>(atmosphere->terms[i].extinction_per_km * 1e-3);
      }
      entry.vertical_transmittance_frac = atmosphere->vertical_transmittance_frac;
      params.vertical_transmittance_frac =
          static_cast<float>(atmosphere->vertical_transmittance_frac);
    }
    params.curvature_k = curvature_k(*lut);
    // Compute the constants of sun and sky.
    entry.sun_outside_w_m2 = sun_outside_w_m2(entry.band);
    entry.sky_frac = sky_frac(entry.vertical_transmittance_frac);
    entry.has_sky = atmosphere != nullptr;
    if (scenario.atmosphere.fog) {
      entry.fog = physics::fog_optics(*scenario.atmosphere.fog, spectral);
      params.fog_per_m = static_cast<float>(entry.fog.extinction_per_m);
      params.fog_wide_per_m = static_cast<float>(entry.fog.wide_extinction_per_m());
    }
    model.nodes_per_band_ = static_cast<std::uint32_t>(lut->nodes().size());
    model.tables_.insert(model.tables_.end(), lut->nodes().begin(), lut->nodes().end());
    model.params_.push_back(params);
    model.entries_.push_back(std::move(entry));
  }
  model.place_m_ = scenario.place.height_m;
  model.turbidity_ = scenario.clear_sky.linke_turbidity;
  model.cloud_base_ = scenario.clear_sky.cloud_base;
  model.clouds_ = scenario.clouds;
  model.fog_ = scenario.atmosphere.fog;
  if (model.fog_) model.fog_shade_ = physics::fog_shade(*model.fog_);
  model.fog_lights_.resize(model.fog_ ? model.entries_.size() : 0);
  model.cloud_views_.resize(model.entries_.size());
  // The sky keeps to one dew point over the whole run: the humidity of a weather table does not
  // count.
  model.dew_point_k_ = scene::usual_dew_point_k(scenario);
  model.lobes_ = LobeModel::build(scenario, materials);
  if (auto views = model.build_views(scenario); !views) return tl::unexpected(views.error());
  // Append the tables of the air behind those of the bands.
  for (std::size_t i = 0; i < model.entries_.size(); ++i) {
    if (!model.entries_[i].air) continue;
    const physics::AtmosphereTable& air = *model.entries_[i].air;
    model.params_[i].air_table_first = static_cast<std::uint32_t>(model.tables_.size());
    model.params_[i].air_table_ranges = static_cast<std::uint32_t>(air.ranges());
    model.params_[i].air_table_elevations = static_cast<std::uint32_t>(air.elevations());
    const std::vector<float> nodes = air.shader_nodes();
    model.tables_.insert(model.tables_.end(), nodes.begin(), nodes.end());
    if (model.tables_.size() > kMaxTableFloats) {
      return make_error(ErrorCode::config,
                        fmt::format("band '{}': the atmosphere tables have more points than a "
                                    "device is sure to take ({} numbers, {} are possible)",
                                    scenario.bands[i].name, model.tables_.size(), kMaxTableFloats));
    }
  }
  // Append the emissivities of all materials, then the lobes of glossy ones.
  model.first_emissivity_ = static_cast<std::uint32_t>(model.tables_.size());
  for (std::size_t m = 0; m < materials.size(); ++m) {
    for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
      const auto glossy = model.lobes_ ? model.lobes_->hemispherical_emissivity_frac(m, b)
                                       : std::optional<double>();
      model.tables_.push_back(static_cast<float>(
          glossy ? *glossy : band_emissivity_frac(materials[m], scenario.bands[b].name)));
    }
  }
  // Append what clutter changes of them, if there is any.
  const bool varies = std::ranges::any_of(
      materials, [](const scene::Material& material) { return material.clutter.has_value(); });
  model.first_emissivity_sd_ =
      varies ? static_cast<std::uint32_t>(model.tables_.size()) : model.first_emissivity_;
  for (std::size_t m = 0; varies && m < materials.size(); ++m) {
    for (const scene::SpectralBand& band : scenario.bands) {
      const std::optional<scene::Clutter>& clutter = materials[m].clutter;
      model.tables_.push_back(
          clutter ? static_cast<float>(scene::emissivity_sd_frac(*clutter, band.name)) : 0.0F);
    }
  }
  if (model.lobes_) {
    model.first_lobe_ = static_cast<std::uint32_t>(model.tables_.size());
    const std::span<const float> lobes = model.lobes_->table();
    model.tables_.insert(model.tables_.end(), lobes.begin(), lobes.end());
  }
  if (model.tables_.size() > kMaxTableFloats) {
    return make_error(ErrorCode::config,
                      fmt::format("{} materials in {} bands: their emissivities and lobes are more "
                                  "than a device is sure to take",
                                  materials.size(), scenario.bands.size()));
  }
  return model;
}

std::vector<physics::ApparentTemperature> BandModel::apparent_temperatures() const {
  std::vector<physics::ApparentTemperature> out;
  for (const Entry& entry : entries_) out.emplace_back(entry.band);
  return out;
}

BandModel::Instant BandModel::instant_of(const physics::Forcing& forcing,
                                         const physics::SunPosition& sun) const noexcept {
  Instant now;
  double longwave_w_m2 = forcing.longwave_down_w_m2;
  if (fog_shade_) {
    longwave_w_m2 = physics::longwave_above_fog_w_m2(
        *fog_shade_, longwave_w_m2, forcing.air_k,
        physics::sky_longwave_w_m2(physics::Kelvin(forcing.air_k), physics::Kelvin(dew_point_k_),
                                   0.0));
  }
  now.sky = clouds_ ? physics::sky_of_cover(longwave_w_m2, forcing.air_k, dew_point_k_,
                                            clouds_->cover_frac, cloud_base_)
                    : physics::sky_state(longwave_w_m2, forcing.air_k, dew_point_k_,
                                         forcing.cloud_frac, cloud_base_);
  now.air_k = forcing.air_k;
  now.cloud_frac = forcing.cloud_frac;
  now.environment_k = forcing.environment_k;
  // The direct sun is weaker than a clear one by what clouds and haze take from the beam.
  now.air_mass = physics::relative_air_mass(sun.elevation);
  if (now.air_mass > 0.0) {
    now.beam_frac = (1.0 - forcing.cloud_frac) *
                    physics::beam_share_frac(forcing.direct_normal_w_m2, sun,
                                             physics::Metres(place_m_), turbidity_);
  }
  now.beam_above_fog_frac = now.beam_frac;
  if (fog_shade_ && sun.direction_enu.z > 0.0) {
    now.beam_above_fog_frac = physics::beam_above_fog_frac(
        *fog_shade_, now.beam_frac, sun.direction_enu.z, 1.0 - forcing.cloud_frac);
  }
  now.sin_sun = std::sin(sun.elevation.value());
  now.sin_shown = std::sin(physics::apparent_elevation(sun.elevation).value());
  now.distance_au = sun.distance_au;
  return now;
}

double BandModel::shown_beam_frac(const Instant& now, double sensor_m) const noexcept {
  const double beam_frac = now.beam_above_fog_frac;
  if (sensor_m < place_m_ + now.sky.cloud_base_m) return beam_frac;
  if (clouds_) return beam_frac * cloud_light_.gain;
  return now.cloud_frac < 1.0 && beam_frac > 0.0 ? beam_frac / (1.0 - now.cloud_frac) : 1.0;
}

void BandModel::update_scattered(const Entry& entry, const Instant& now, double sensor_m,
                                 std::size_t band) noexcept {
  params_[band].air_sun_first = 0;
  if (!entry.view->scatters() || !(now.sin_shown > 0.0)) return;
  const double beam_frac = shown_beam_frac(now, sensor_m);
  if (!(now.air_mass > 0.0 && beam_frac > 0.0)) return;
  sunlit_ = true;
  params_[band].air_sun_first = static_cast<std::uint32_t>(sun_nodes_[band]);
  entry.view->sun_at(sensor_m,
                     {.sin_elevation = now.sin_shown,
                      .share_frac = beam_frac / (now.distance_au * now.distance_au)},
                     std::span(air_nodes_).subspan(sun_nodes_[band], physics::AirView::kSunNodes));
}

std::span<const physics::AirView::Node> BandModel::sun_nodes_of(std::size_t band) const noexcept {
  return std::span(air_nodes_)
      .subspan(sun_nodes_[band],
               params_[band].air_sun_first != 0 ? physics::AirView::kSunNodes : 0);
}

void BandModel::update_bodies(const Entry& entry, const Instant& now,
                              const physics::MoonPosition& moon, double sensor_m,
                              gpu::BandParams& params) const noexcept {
  // The built-in air is looked up by pixel; other air is taken towards the middle of the disc.
  const auto through = [&](const glm::dvec3& towards) {
    if (entry.view) return 1.0;
    if (towards.z <= 0.0) return 0.0;
    if (entry.air) return entry.air->out(towards.z).transmittance_frac;
    return std::pow(entry.vertical_transmittance_frac,
                    physics::relative_air_mass(physics::Radians(std::asin(towards.z))));
  };
  const double cover_frac = even_cover_frac(entry, now, sensor_m);
  const double beam_frac = shown_beam_frac(now, sensor_m);
  const double sine = std::sin(physics::kSunSemiAngleRad);
  params.sun_disc_w_m2_sr =
      static_cast<float>(entry.sun_outside_w_m2 * beam_frac * through({0.0, 0.0, now.sin_sun}) /
                         (physics::kPi * sine * sine));
  params.moon_through_frac = static_cast<float>((1.0 - cover_frac) * through(moon.direction_enu));
  params.moon_reflected_w_m2_sr =
      static_cast<float>((1.0 - physics::kMoonEmissivityFrac) * entry.sun_outside_w_m2 /
                         (moon.sun_au * moon.sun_au) / physics::kPi);
}

void BandModel::update(const physics::Forcing& forcing, const physics::SunPosition& sun,
                       const physics::MoonPosition& moon, double sensor_m,
                       const physics::CloudLight& cloud_light) noexcept {
  const Instant now = instant_of(forcing, sun);
  cloud_light_ = cloud_light;
  if (fog_) fog_above_m_ = static_cast<float>(place_m_ + fog_->top_m - sensor_m);
  fog_k_ = static_cast<float>(now.air_k);
  sunlit_ = false;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    gpu::BandParams& params = params_[i];
    BandLight light;
    light_of(i, now, light);
    params.surroundings_radiance_w_m2_sr = light.surroundings_w_m2_sr;
    params.sun_irradiance_w_m2 = light.sun_w_m2;
    for (std::size_t t = 0; t < physics::kSkyTilts; ++t) {
      params.sky_by_tilt_w_m2_sr[t / 4][static_cast<glm::length_t>(t % 4)] = light.sky_w_m2_sr[t];
    }
    // Set what the camera sees of air and sky.
    const auto black = [&](double kelvin) {
      return physics::band_radiance(entry.band, physics::Kelvin(kelvin)).radiance_w_m2_sr;
    };
    params.air_radiance_w_m2_sr = static_cast<float>(black(now.air_k));
    params.sky_air_radiance_w_m2_sr = static_cast<float>(black(now.air_k + now.sky.warmer_k));
    if (fog_) {
      const auto& fog = fog_lights_[i] = fog_light_of(i, now, sky_above_fog(i, now));
      params.fog_light_w_m2_sr = glm::vec4(
          glm::dvec4(fog.black_w_m2_sr, fog.sky_w_m2_sr, fog.ground_w_m2_sr, fog.sun_w_m2_sr));
      params.fog_rates =
          glm::vec4(glm::dvec4(fog.rate_per_m, fog.sun_rate_per_m, fog.depth_m, 0.0));
    }
    update_clouds(i, now, sensor_m);
    update_bodies(entry, now, moon, sensor_m, params);
    if (lobes_) update_lobe_sky(i, now);
    if (!entry.view) continue;
    entry.view->at(sensor_m,
                   {.warmer_k = warmer_k(entry, now), .sky_warmer_k = sky_warmer_k(entry, now)},
                   std::span(air_nodes_).subspan(params.air_view_first, physics::AirView::kNodes));
    update_scattered(entry, now, sensor_m, i);
  }
}

std::span<const physics::AirView::Node> BandModel::air_nodes_of(std::size_t band) const noexcept {
  return std::span(air_nodes_)
      .subspan(params_[band].air_view_first, entries_[band].view ? physics::AirView::kNodes : 0);
}

double air_transmittance(std::span<const physics::AirView::Node> nodes,
                         const BandModel::Sight& sight, float temperature_k) noexcept {
  const float target_m = sight.sensor_height_m + sight.range_m * sight.sin_elevation;
  const auto node = physics::air_sight_node(nodes, target_m, sight.range_m);
  return std::exp(-std::exp(physics::air_log_extinction(node, temperature_k)) * sight.range_m);
}

BandModel::AirWay BandModel::clear_way(std::size_t band, const Sight& sight,
                                       float temperature_k) const noexcept {
  const Entry& entry = entries_[band];
  const gpu::BandParams& params = params_[band];
  AirWay out;
  if (entry.view) {
    const auto nodes = air_nodes_of(band);
    const float target_m = sight.sensor_height_m + sight.range_m * sight.sin_elevation;
    const auto node = physics::air_sight_node(nodes, target_m, sight.range_m);
    out.air_frac = air_transmittance(nodes, sight, temperature_k);
    out.air_sun_frac = std::exp(-std::exp(node[2]) * sight.range_m);
    out.path_w_m2_sr = physics::air_path_w_m2_sr(node, sight.range_m);
    const auto sun_nodes = sun_nodes_of(band);
    if (!sun_nodes.empty()) {
      // The light is tabulated as the thermal radiance is, by 1 - tau.
      auto scattered = node;
      scattered[3] =
          physics::air_sun_w_m2_sr(physics::air_sight_node(sun_nodes, target_m, sight.range_m),
                                   physics::air_sun_phase(sun_nodes, sight.ray_sun_cosine));
      out.scattered_w_m2_sr = physics::air_path_w_m2_sr(scattered, sight.range_m);
    }
  } else if (entry.air) {
    const auto air = entry.air->along(sight.range_m, sight.sin_elevation);
    out.air_frac = out.air_sun_frac = air.transmittance_frac;
    out.path_w_m2_sr = air.path_radiance_w_m2_sr;
  } else if (entry.has_sky) {
    out.air_frac = 0.0;
    for (glm::length_t term = 0; term < EMIT_MAX_ATMOSPHERE_TERMS; ++term) {
      out.air_frac += params.terms_amplitude_frac[term] *
                      std::exp(-params.terms_extinction_per_m[term] * sight.range_m);
    }
    out.air_sun_frac = out.air_frac;
    out.path_w_m2_sr = (1.0 - out.air_frac) * params.air_radiance_w_m2_sr;
  }
  return out;
}

RadianceTerms BandModel::terms(std::size_t band, const Seen& seen,
                               float incoming_w_m2_sr) const noexcept {
  const Entry& entry = entries_[band];
  const gpu::BandParams& params = params_[band];
  RadianceTerms out;
  if (!seen.surface) {
    double sun_through_frac = 1.0;
    double moon_through_frac = params.moon_through_frac;
    if (entry.view) {
      const physics::AirSight sky = physics::air_sky(air_nodes_of(band), seen.sin_elevation);
      out.path_w_m2_sr = sky.path_radiance_w_m2_sr;
      const auto sun_nodes = sun_nodes_of(band);
      if (!sun_nodes.empty()) {
        out.scattered_w_m2_sr =
            physics::air_sun_w_m2_sr(physics::air_sky_node(sun_nodes, seen.sin_elevation),
                                     physics::air_sun_phase(sun_nodes, seen.ray_sun_cosine));
      }
      moon_through_frac *= sky.transmittance_frac[0];
      sun_through_frac = sky.transmittance_frac[2];
    } else if (entry.air) {
      out.path_w_m2_sr = entry.air->out(seen.sin_elevation).path_radiance_w_m2_sr;
    } else if (entry.has_sky) {
      const double mass = physics::relative_air_mass(
          physics::Radians(std::asin(std::clamp(seen.sin_elevation, 0.0F, 1.0F))));
      out.path_w_m2_sr = params.sky_air_radiance_w_m2_sr *
                         (1.0 - std::pow(entry.vertical_transmittance_frac, mass));
    }
    // Put clouds before the sky, and before sun and moon.
    const double clear_frac = 1.0 - static_cast<double>(seen.cloud_frac);
    const double cover_frac = clouds_ ? static_cast<double>(seen.cloud_frac)
                                      : static_cast<double>(params.cloud_cover_frac);
    if (cover_frac > 0.0) {
      const float cloud = physics::sky_at_elevation(cloud_views_[band], seen.sin_elevation);
      out.path_w_m2_sr = (1.0 - cover_frac) * out.path_w_m2_sr + cover_frac * cloud;
      out.scattered_w_m2_sr *= 1.0 - cover_frac;
    }
    if (clouds_) {
      const bool above = seen.sensor_height_m >= place_m_ + clouds_->base_m;
      if (!above) sun_through_frac *= cloud_light_.by_mean(seen.cloud_frac);
    }
    out.bodies_w_m2_sr = seen.bodies.sun_frac * sun_through_frac * params.sun_disc_w_m2_sr;
    if (seen.bodies.moon_frac > 0.0F) {
      double sum = 0.0;
      double weights = 0.0;
      for (std::size_t p = 0; p < seen.bodies.moon_points; ++p) {
        sum += seen.bodies.moon_weight[p] *
               (physics::kMoonEmissivityFrac * black_w_m2_sr(band, seen.bodies.moon_k[p]) +
                seen.bodies.moon_cosine[p] * params.moon_reflected_w_m2_sr);
        weights += seen.bodies.moon_weight[p];
      }
      out.bodies_w_m2_sr += clear_frac * seen.bodies.moon_frac * moon_through_frac * sum / weights;
    }
    if (fog_) {
      const Sight sight{static_cast<float>(physics::kFogFarM), seen.sin_elevation,
                        seen.sensor_height_m, seen.ray_sun_cosine};
      (void)put_fog_before(band, sight, fog_lights_[band].wide_per_m, out.path_w_m2_sr,
                           out.scattered_w_m2_sr);
      const auto fog = physics::fog_stretch(fog_above_m_, sight.sin_elevation, sight.range_m);
      out.bodies_w_m2_sr *= std::exp(-fog_lights_[band].extinction_per_m * double{fog.length_m});
    }
    return out;
  }
  // Find what the air lets through and what it adds.
  const AirWay way =
      air_way(band, {seen.range_m, seen.sin_elevation, seen.sensor_height_m, seen.ray_sun_cosine},
              seen.temperature_k);
  out.air_frac = way.air_frac;
  out.air_sun_frac = way.air_sun_frac;
  out.path_w_m2_sr = way.path_w_m2_sr;
  out.scattered_w_m2_sr = way.scattered_w_m2_sr;
  // Split what leaves the surface.
  out.emissivity_frac = emissivity_frac(seen.material, band);
  float emitting_k = seen.temperature_k;
  if (first_emissivity_sd_ != first_emissivity_) {
    out.emissivity_frac += static_cast<double>(
        seen.clutter_sd * tables_[first_emissivity_sd_ + seen.material * entries_.size() + band]);
    const float per_k = 1.0F / std::max(emitting_k, 1.0F);
    emitting_k += 0.5F * seen.clutter_variance_k2 * (params.curvature_k * per_k - 2.0F) * per_k;
  }
  const double reflected = (1.0 - out.emissivity_frac) * out.air_frac;
  physics::SkyByTilt sky{};
  for (std::size_t t = 0; t < physics::kSkyTilts; ++t) {
    sky[t] = params.sky_by_tilt_w_m2_sr[t / 4][static_cast<glm::length_t>(t % 4)];
  }
  const double from_sky = seen.open_frac * physics::sky_at_tilt(sky, seen.normal_up);
  if (lobes_) {
    const auto glossy = lobes_->parts(
        band,
        {seen.material, seen.normal, seen.to_viewer, seen.to_sun, seen.open_frac, seen.sun_cosine,
         seen.glint_per_sr},
        {incoming_w_m2_sr, static_cast<float>(physics::sky_at_tilt(sky, seen.normal.z)),
         params.surroundings_radiance_w_m2_sr},
        std::span(air_nodes_).first(LobeModel::kSkyTable));
    if (glossy) {
      const double diffuse_sky = seen.open_frac * physics::sky_at_tilt(sky, seen.normal.z);
      out.emissivity_frac = glossy->emissivity_frac;
      out.emission_w_m2_sr = out.emissivity_frac * black_w_m2_sr(band, emitting_k) * out.air_frac;
      out.sky_w_m2_sr = glossy->diffuse_frac * diffuse_sky * out.air_frac;
      out.neighbours_w_m2_sr =
          glossy->diffuse_frac * (incoming_w_m2_sr - diffuse_sky) * out.air_frac;
      out.lobe_sky_w_m2_sr = glossy->lobe_sky_w_m2_sr * out.air_frac;
      out.lobe_neighbours_w_m2_sr = glossy->lobe_neighbours_w_m2_sr * out.air_frac;
      const double sun = params.sun_irradiance_w_m2 * out.air_sun_frac;
      out.sun_w_m2_sr = glossy->diffuse_sun_per_sr * sun;
      out.glint_w_m2_sr = glossy->glint_per_sr * sun;
      return out;
    }
  }
  out.emission_w_m2_sr = out.emissivity_frac * black_w_m2_sr(band, emitting_k) * out.air_frac;
  out.sky_w_m2_sr = reflected * from_sky;
  out.neighbours_w_m2_sr = reflected * (incoming_w_m2_sr - from_sky);
  out.sun_w_m2_sr = (1.0 - out.emissivity_frac) * params.sun_irradiance_w_m2 / physics::kPi *
                    seen.sun_cosine * out.air_sun_frac;
  return out;
}

std::vector<gpu::MaterialParams> material_params(std::span<const scene::Material> materials,
                                                 const scene::ScenarioDesc& scenario,
                                                 double reference_k) {
  std::vector<gpu::MaterialParams> out;
  out.reserve(materials.size());
  for (const scene::Material& material : materials) {
    // Copy the surface and its conductance to the core.
    gpu::MaterialParams params{};
    params.solar_absorptance_frac = static_cast<float>(material.solar_absorptance_frac);
    params.emissivity_frac = static_cast<float>(material.emissivity_frac);
    const physics::FilmSkin skin = scene::film_skin(material);
    params.roughness = static_cast<float>(skin.roughness);
    params.leaf_forced = static_cast<float>(skin.leaf_forced);
    params.leaf_natural = static_cast<float>(skin.leaf_natural);
    const physics::MoistSurface moisture = scene::moisture_of(material);
    params.wetness_frac = static_cast<float>(moisture.wetness_frac);
    params.resistance_s_m = static_cast<float>(moisture.resistance_s_m);
    params.night_resistance_s_m = static_cast<float>(moisture.night_resistance_s_m);
    if (material.core_conductance_w_m2_k) {
      params.conductance_w_m2_k = static_cast<float>(*material.core_conductance_w_m2_k);
    } else if (!material.layers.empty()) {
      params.conductance_w_m2_k = static_cast<float>(material.layers[0].conductivity_w_m_k /
                                                     material.layers[0].thickness_m);
    }
    // Store temperatures as offsets from the reference.
    params.base_k = static_cast<float>(material.base_k);
    params.base_offset_k = static_cast<float>(material.base_k - reference_k);
    params.initial_offset_k =
        static_cast<float>(material.initial_k.value_or(scenario.thermal.initial_k) - reference_k);
    if (material.prescribed_k) {
      params.prescribed = 1.0F;
      params.prescribed_offset_k = static_cast<float>(*material.prescribed_k - reference_k);
    }
    out.push_back(params);
  }
  return out;
}

}  // namespace emit::renderer
