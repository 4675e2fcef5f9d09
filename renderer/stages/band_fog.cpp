// SPDX-License-Identifier: Apache-2.0
// Fog of a band: before what the camera sees, and before the sky that surfaces see.
#include <algorithm>
#include <cmath>

#include "emit/physics/clear_sky.hpp"
#include "stages/band_model.hpp"

namespace emit::renderer {

double BandModel::put_fog_before(std::size_t band, const Sight& sight, double extinction_per_m,
                                 double& path_w_m2_sr, double& scattered_w_m2_sr) const noexcept {
  const auto fog = physics::fog_stretch(fog_above_m_, sight.sin_elevation, sight.range_m);
  const double through = std::exp(-extinction_per_m * double{fog.length_m});
  const double glow_w_m2_sr = physics::fog_glow_w_m2_sr(
      fog_lights_[band], extinction_per_m, std::max(double{fog_above_m_}, 0.0),
      double{sight.sin_elevation}, double{fog.length_m});
  AirWay before;
  if (fog.begin_m > 0.0F) {
    Sight to_fog = sight;
    to_fog.range_m = fog.begin_m;
    before = clear_way(band, to_fog, fog_k_);
  }
  path_w_m2_sr = through * path_w_m2_sr + (1.0 - through) * before.path_w_m2_sr +
                 before.air_frac * glow_w_m2_sr;
  scattered_w_m2_sr = through * scattered_w_m2_sr + (1.0 - through) * before.scattered_w_m2_sr;
  return through;
}

BandModel::AirWay BandModel::air_way(std::size_t band, const Sight& sight,
                                     float temperature_k) const noexcept {
  AirWay out = clear_way(band, sight, temperature_k);
  if (!fog_) return out;
  out.fog_frac = put_fog_before(band, sight, fog_lights_[band].extinction_per_m, out.path_w_m2_sr,
                                out.scattered_w_m2_sr);
  out.air_frac *= out.fog_frac;
  out.air_sun_frac *= out.fog_frac;
  return out;
}

double BandModel::clear_sky_w_m2_sr(const Entry& entry, const Instant& now,
                                    double sin_elevation) const noexcept {
  if (entry.view) {
    double clear_w_m2_sr =
        entry.view->clear_sky_w_m2_sr(place_m_, sky_warmer_k(entry, now), sin_elevation);
    if (entry.view->scatters() && now.beam_above_fog_frac > 0.0) {
      clear_w_m2_sr += now.beam_above_fog_frac / (now.distance_au * now.distance_au) *
                       entry.view->scattered_sky_w_m2_sr(place_m_, now.sin_shown, sin_elevation);
    }
    return clear_w_m2_sr;
  }
  if (entry.air) return entry.air->out(sin_elevation).path_radiance_w_m2_sr;
  if (!entry.has_sky) return 0.0;
  const double up = std::asin(std::clamp(sin_elevation, 0.0, 1.0));
  const double mass = physics::relative_air_mass(physics::Radians(up));
  return physics::band_radiance(entry.band, physics::Kelvin(now.air_k + now.sky.warmer_k))
             .radiance_w_m2_sr *
         (1.0 - std::pow(entry.vertical_transmittance_frac, mass));
}

physics::AirView::ByElevation BandModel::sky_above_fog(std::size_t band,
                                                       const Instant& now) const noexcept {
  const Entry& entry = entries_[band];
  const double cover_frac = entry.has_sky ? now.sky.cloud_cover_frac : 0.0;
  physics::AirView::ByElevation sky{};
  if (cover_frac > 0.0) sky = clouds_by_elevation(band, now, place_m_);
  for (std::size_t e = 0; e < sky.size(); ++e) {
    const double clear_w_m2_sr = clear_sky_w_m2_sr(entry, now, physics::AirView::node_sine(e));
    sky[e] = static_cast<float>(std::lerp(clear_w_m2_sr, double{sky[e]}, cover_frac));
  }
  return sky;
}

physics::FogLight<double> BandModel::fog_light_of(
    std::size_t band, const Instant& now,
    const physics::AirView::ByElevation& above) const noexcept {
  const Entry& entry = entries_[band];
  const auto black = [&](double kelvin) {
    return physics::band_radiance(entry.band, physics::Kelvin(kelvin)).radiance_w_m2_sr;
  };
  return physics::fog_light(
      entry.fog, fog_->top_m,
      {.black_w_m2_sr = black(now.air_k),
       .sky_w_m2_sr = physics::sky_by_tilt_of(above).front(),
       .ground_w_m2_sr = black(now.environment_k),
       .sun_w_m2 = now.beam_above_fog_frac * entry.sun_outside_w_m2 /
                   (now.distance_au * now.distance_au) * sun_through_frac(entry, now),
       .sin_sun = now.sin_shown});
}

double BandModel::through_fog_w_m2_sr(const physics::FogLight<double>& light, double above_w_m2_sr,
                                      double sin_elevation) const noexcept {
  const auto fog = physics::fog_stretch(fog_->top_m, sin_elevation, physics::kFogFarM);
  return std::exp(-light.wide_per_m * fog.length_m) * above_w_m2_sr +
         physics::fog_glow_w_m2_sr(light, light.wide_per_m, fog_->top_m, sin_elevation,
                                   fog.length_m);
}

}  // namespace emit::renderer
