// SPDX-License-Identifier: Apache-2.0
// The sky of a band: its clear part, its clouds, and what of it surfaces see.
#include <algorithm>
#include <cmath>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/sky/cloud_field.hpp"
#include "stages/band_model.hpp"

namespace emit::renderer {

double BandModel::warmer_k(const Entry& entry, const Instant& now) const noexcept {
  // The place's air differs from that of the climate, and the difference fades upwards.
  return (now.air_k - entry.climate_k) * std::exp(place_m_ / physics::BandAir::kWarmthScaleM);
}

double BandModel::sky_warmer_k(const Entry& entry, const Instant& now) const noexcept {
  return warmer_k(entry, now) +
         now.sky.warmer_k * std::exp(place_m_ / physics::BandAir::kWarmthScaleM);
}

physics::AirView::ByElevation BandModel::clouds_by_elevation(std::size_t band, const Instant& now,
                                                             double sensor_m) const noexcept {
  const Entry& entry = entries_[band];
  const double base_m = place_m_ + now.sky.cloud_base_m;
  const auto black = [&](double kelvin) {
    return physics::band_radiance(entry.band, physics::Kelvin(kelvin)).radiance_w_m2_sr;
  };
  const double base_w_m2_sr = black(now.sky.cloud_base_k);
  if (entry.view) {
    return entry.view->layer_w_m2_sr(
        sensor_m, sky_warmer_k(entry, now),
        {.height_m = base_m, .kelvin = now.sky.cloud_base_k, .radiance_w_m2_sr = base_w_m2_sr});
  }
  const double air_w_m2_sr = black(now.air_k + now.sky.warmer_k);
  physics::AirView::ByElevation out;
  for (std::size_t e = 0; e < out.size(); ++e) {
    const double sine = physics::AirView::node_sine(e);
    double through = 1.0;
    double path_w_m2_sr = 0.0;
    if (entry.air) {
      const double range_m = physics::cloud_range_m(std::max(base_m - sensor_m, 1.0), sine);
      const auto air = entry.air->along(range_m, sine);
      through = air.transmittance_frac;
      path_w_m2_sr = air.path_radiance_w_m2_sr;
    } else {
      // All of the air lies below the clouds, as eq. 12 has it.
      const double up = std::asin(std::clamp(sine, 0.0, 1.0));
      const double mass = physics::relative_air_mass(physics::Radians(up));
      through = std::pow(entry.vertical_transmittance_frac, mass);
      path_w_m2_sr = (1.0 - through) * air_w_m2_sr;
    }
    out[e] = static_cast<float>(through * base_w_m2_sr + path_w_m2_sr);
  }
  return out;
}

void BandModel::update_clouds(std::size_t band, const Instant& now, double sensor_m) noexcept {
  const Entry& entry = entries_[band];
  gpu::BandParams& params = params_[band];
  params.cloud_cover_frac = static_cast<float>(even_cover_frac(entry, now, sensor_m));
  const bool shown = clouds_ ? entry.has_sky : params.cloud_cover_frac > 0.0F;
  cloud_views_[band] =
      shown ? clouds_by_elevation(band, now, sensor_m) : physics::AirView::ByElevation{};
  for (std::size_t e = 0; e < cloud_views_[band].size(); ++e) {
    params.cloud_w_m2_sr[e / 4][static_cast<glm::length_t>(e % 4)] = cloud_views_[band][e];
  }
}

double BandModel::sun_through_frac(const Entry& entry, const Instant& now) const noexcept {
  if (entry.view) return entry.view->sun_transmittance_frac(place_m_, now.sin_shown);
  if (entry.air) return entry.air->out(now.sin_sun).transmittance_frac;
  return std::pow(entry.vertical_transmittance_frac, now.air_mass);
}

void BandModel::light_of(std::size_t band, const Instant& now, BandLight& out) const noexcept {
  const Entry& entry = entries_[band];
  const auto black = [&](double kelvin) {
    return physics::band_radiance(entry.band, physics::Kelvin(kelvin)).radiance_w_m2_sr;
  };
  out.surroundings_w_m2_sr = static_cast<float>(black(now.environment_k));
  out.sun_w_m2 = static_cast<float>(entry.sun_outside_w_m2 / (now.distance_au * now.distance_au) *
                                    now.beam_frac * sun_through_frac(entry, now));
  if (fog_) {
    physics::AirView::ByElevation sky = sky_above_fog(band, now);
    const auto fog = fog_light_of(band, now, sky);
    for (std::size_t e = 0; e < sky.size(); ++e) {
      sky[e] = static_cast<float>(
          through_fog_w_m2_sr(fog, double{sky[e]}, physics::AirView::node_sine(e)));
    }
    const physics::SkyByTilt below_w_m2_sr = physics::sky_by_tilt_of(sky);
    std::ranges::transform(below_w_m2_sr, out.sky_w_m2_sr.begin(),
                           [](double radiance) { return static_cast<float>(radiance); });
    return;
  }
  // Take the clear sky from the kind of air that the band has.
  physics::SkyByTilt clear_w_m2_sr{};
  if (entry.view) {
    clear_w_m2_sr = entry.view->clear_sky_by_tilt_w_m2_sr(place_m_, sky_warmer_k(entry, now));
    if (entry.view->scatters() && now.beam_frac > 0.0) {
      const double share = now.beam_frac / (now.distance_au * now.distance_au);
      const auto scattered = entry.view->scattered_sky_by_tilt_w_m2_sr(place_m_, now.sin_shown);
      for (std::size_t t = 0; t < physics::kSkyTilts; ++t) clear_w_m2_sr[t] += share * scattered[t];
    }
  } else if (entry.air) {
    clear_w_m2_sr = entry.air_sky_w_m2_sr;
  } else {
    const double sky_air_w_m2_sr = black(now.air_k + now.sky.warmer_k);
    for (std::size_t t = 0; t < physics::kSkyTilts; ++t) {
      clear_w_m2_sr[t] = sky_air_w_m2_sr * entry.sky_frac[t];
    }
  }
  // Clouds cover the same share in all directions.
  const double cover_frac = entry.has_sky ? now.sky.cloud_cover_frac : 0.0;
  physics::SkyByTilt clouds_w_m2_sr{};
  if (cover_frac > 0.0) {
    clouds_w_m2_sr = physics::sky_by_tilt_of(clouds_by_elevation(band, now, place_m_));
  }
  for (std::size_t t = 0; t < physics::kSkyTilts; ++t) {
    out.sky_w_m2_sr[t] =
        static_cast<float>((1.0 - cover_frac) * clear_w_m2_sr[t] + cover_frac * clouds_w_m2_sr[t]);
  }
}

void BandModel::light_at(const physics::Forcing& forcing, const physics::SunPosition& sun,
                         std::span<BandLight> out) const noexcept {
  const Instant now = instant_of(forcing, sun);
  for (std::size_t i = 0; i < entries_.size(); ++i) light_of(i, now, out[i]);
}

void BandModel::update_lobe_sky(std::size_t band, const Instant& now) noexcept {
  const Entry& entry = entries_[band];
  const double cover_frac = entry.has_sky ? now.sky.cloud_cover_frac : 0.0;
  const auto clouds_w_m2_sr =
      cover_frac > 0.0 ? clouds_by_elevation(band, now, place_m_) : physics::AirView::ByElevation{};
  physics::FogLight<double> fog;
  if (fog_) fog = fog_light_of(band, now, sky_above_fog(band, now));
  std::array<double, LobeModel::kSkySamples> sky_w_m2_sr{};
  for (std::size_t s = 0; s < sky_w_m2_sr.size(); ++s) {
    const double sine = LobeModel::sky_sample_sine(s);
    const double clear_w_m2_sr = clear_sky_w_m2_sr(entry, now, sine);
    const auto cloud_w_m2_sr =
        static_cast<double>(physics::sky_at_elevation(clouds_w_m2_sr, static_cast<float>(sine)));
    const double above = (1.0 - cover_frac) * clear_w_m2_sr + cover_frac * cloud_w_m2_sr;
    sky_w_m2_sr[s] = fog_ ? through_fog_w_m2_sr(fog, above, sine) : above;
  }
  lobes_->update_sky(band, sky_w_m2_sr, std::span(air_nodes_).first(LobeModel::kSkyTable));
}

}  // namespace emit::renderer
