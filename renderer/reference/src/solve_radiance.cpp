// SPDX-License-Identifier: Apache-2.0
#include "solve_radiance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/sky/cloud_field.hpp"
#include "emit/physics/sky/moon.hpp"

namespace emit::reference {
namespace {

// Gauss-Legendre rule of ten points on (0, 1). It is symmetric, so five are listed.
constexpr std::array<double, 5> kAbscissa{0.0130467357414141, 0.0674683166555077,
                                          0.1602952158504878, 0.2833023029353764,
                                          0.4255628305091844};
constexpr std::array<double, 5> kWeight{0.0333356721543441, 0.0747256745752903, 0.1095431812579910,
                                        0.1346333596549982, 0.1477621123573765};
constexpr double kWidestPanelUm = 1.0;

constexpr std::array<physics::AirSource, 3> kSources{physics::AirSource::black_300k,
                                                     physics::AirSource::black_800k,
                                                     physics::AirSource::sun_lowtran};

/// Returns what the air lets through of a source at a temperature: its spectrum lies between those
/// of kSources, 300 K, 800 K and the sun, by its inverse temperature.
double thermal_frac(const std::array<double, 3>& tau, double kelvin) {
  const auto log_depth = [](double t) {
    return std::log(-std::log(std::clamp(t, 1e-30, 1.0 - 1e-12)));
  };
  const double inverse = 1.0 / std::max(kelvin, 200.0);
  const double warm = (1.0 / 300.0 - inverse) / (1.0 / 300.0 - 1.0 / 800.0);
  const double hot = (1.0 / 800.0 - inverse) / (1.0 / 800.0 - 1.0 / physics::kSunTemperatureK);
  const double depth = hot > 0.0
                           ? std::lerp(log_depth(tau[1]), log_depth(tau[2]), std::min(hot, 1.0))
                           : std::lerp(log_depth(tau[0]), log_depth(tau[1]), warm);
  return std::exp(-std::exp(depth));
}

/// Returns the air mass at a sine of the elevation, at least 0.
double air_mass(double sin_elevation) {
  return physics::relative_air_mass(
      physics::Radians(std::asin(std::clamp(sin_elevation, 0.0, 1.0))));
}

}  // namespace

BandIntegral::BandIntegral(const scene::SpectralBand& band) {
  std::vector<scene::ResponseSample> curve;
  for (const physics::ResponsePoint& point : scene::spectral_band(band).response) {
    curve.push_back({point.wavelength_um, point.response_frac});
  }
  if (curve.empty()) curve = {{band.lo_um, 1.0}, {band.hi_um, 1.0}};
  // Cut every stretch of the response into panels and put the points of the rule on each.
  for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
    const double low = curve[i].wavelength_um;
    const double width = curve[i + 1].wavelength_um - low;
    const double panels = std::max(1.0, std::ceil(width / kWidestPanelUm));
    // Add one point: the exponent of Planck's law and all factors that do not depend on
    // temperature.
    const auto add = [&](double share, double weight) {
      const double um = low + share * width;
      const double response =
          curve[i].response_frac + share * (curve[i + 1].response_frac - curve[i].response_frac);
      points_.push_back(
          {physics::kC2UmK / um,
           weight * width * response * physics::kRadianceC1WUm4PerM2Sr / std::pow(um, 5)});
    };
    for (double panel = 0.0; panel < panels; panel += 1.0) {
      for (std::size_t g = 0; g < kAbscissa.size(); ++g) {
        add((panel + kAbscissa[g]) / panels, kWeight[g] / panels);
        add((panel + 1.0 - kAbscissa[g]) / panels, kWeight[g] / panels);
      }
    }
  }
}

double BandIntegral::radiance_w_m2_sr(double kelvin) const {
  if (!(kelvin > 0.0)) return kelvin == 0.0 ? 0.0 : std::nan("");
  // Sum Planck's law over the points; the exponent is limited, because exp() overflows above.
  double sum = 0.0;
  for (const Point& p : points_)
    sum += p.weight / std::expm1(std::min(700.0, p.exponent_k / kelvin));
  return sum;
}

physics::SkyState sky_by_bisection(double longwave_down_w_m2, double air_k, double dew_point_k,
                                   double cloud_frac, const physics::CloudBase& base) {
  const auto black = [](double kelvin) {
    return physics::kStefanBoltzmannWPerM2K4 * std::pow(kelvin, 4.0);
  };
  // Returns where a rising function meets the irradiance, or the nearer end.
  const auto meet = [&](double low, double high, const auto& sent) {
    for (int i = 0; i < 80; ++i) {
      const double middle = 0.5 * (low + high);
      (sent(middle) < longwave_down_w_m2 ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  const double dew_c = dew_point_k - physics::kZeroCelsiusK;
  const double emissivity = std::min(1.0, 0.758 + 5.21e-3 * dew_c + 6.25e-5 * dew_c * dew_c);
  const double clear = emissivity * black(air_k);
  const double clear_k = air_k * std::pow(emissivity, 0.25);
  const double under_base = clear + (1.0 - emissivity) * black(physics::cloud_base_k(base, air_k));
  physics::SkyState sky;
  sky.cloud_cover_frac = std::max(
      cloud_frac, meet(0.0, 1.0, [&](double n) { return (1.0 - n) * clear + n * under_base; }));
  const double n = sky.cloud_cover_frac;
  const auto sent = [&](double cloud_k) { return (1.0 - n) * clear + n * black(cloud_k); };
  sky.cloud_k = meet(clear_k, air_k, sent);
  const double warmth = std::pow(std::max(longwave_down_w_m2 / sent(sky.cloud_k), 1e-8), 0.25);
  sky.warmer_k = air_k * (warmth - 1.0);
  // Clouds that send more or less than those of the stated base hang elsewhere.
  sky.cloud_base_m = physics::cloud_base_m(base, air_k);
  sky.cloud_base_k = physics::cloud_base_k(base, air_k);
  if (!base.height_m && emissivity < 1.0) {
    const double base4 = (black(sky.cloud_k) - clear) / (1.0 - emissivity);
    sky.cloud_base_k =
        std::clamp(std::pow(std::max(base4, 0.0) / physics::kStefanBoltzmannWPerM2K4, 0.25),
                   physics::kColdestCloudK, air_k);
    sky.cloud_base_m = std::max(physics::kLowestInferredBaseM,
                                physics::cloud_base_m({.kelvin = sky.cloud_base_k}, air_k));
  }
  sky.cloud_k *= warmth;
  sky.cloud_base_k *= warmth;
  return sky;
}

physics::SkyState covered_sky_by_bisection(double longwave_down_w_m2, double air_k,
                                           double dew_point_k, double cover_frac,
                                           const physics::CloudBase& base) {
  const auto black = [](double kelvin) {
    return physics::kStefanBoltzmannWPerM2K4 * std::pow(kelvin, 4.0);
  };
  const double dew_c = dew_point_k - physics::kZeroCelsiusK;
  const double emissivity = std::min(1.0, 0.758 + 5.21e-3 * dew_c + 6.25e-5 * dew_c * dew_c);
  const double clear = emissivity * black(air_k);
  const auto sent = [&](double kelvin) {
    return (1.0 - cover_frac) * clear + cover_frac * black(kelvin);
  };
  double low_k = air_k * std::pow(emissivity, 0.25);
  double high_k = air_k;
  for (int i = 0; i < 80; ++i) {
    const double middle_k = 0.5 * (low_k + high_k);
    (sent(middle_k) < longwave_down_w_m2 ? low_k : high_k) = middle_k;
  }
  // The rest, which the clouds cannot take, warms or cools all of the sky.
  const double warmth = std::pow(std::max(longwave_down_w_m2 / sent(low_k), 1e-8), 0.25);
  physics::SkyState sky;
  sky.cloud_cover_frac = cover_frac;
  sky.cloud_base_m = physics::cloud_base_m(base, air_k);
  sky.cloud_base_k = physics::cloud_base_k(base, air_k) * warmth;
  sky.cloud_k = low_k * warmth;
  sky.warmer_k = air_k * (warmth - 1.0);
  return sky;
}

physics::Result<BandRadiance> BandRadiance::create(const scene::ScenarioDesc& scenario,
                                                   std::size_t band) {
  BandRadiance out(scenario.bands[band]);
  // Take the band's air: a table, or terms of extinction.
  if (scenario.atmosphere.enabled) {
    for (const scene::BandAtmosphere& entry : scenario.atmosphere.bands) {
      if (entry.band != out.name_) continue;
      out.has_air_ = true;
      if (entry.model) {
        auto column = physics::AirColumn::build(*entry.model);
        auto terms = physics::BandAir::build(scene::spectral_band(scenario.bands[band]));
        if (!column || !terms) {
          return physics::make_error(
              physics::ErrorCode::config,
              fmt::format("band '{}': {}", out.name_,
                          column ? terms.error().text : column.error().text));
        }
        out.air_terms_ = std::move(*terms);
        out.column_ = std::move(*column);
        out.scatter_ =
            physics::SunScatter::build(*out.column_, scene::spectral_band(scenario.bands[band]));
      } else if (entry.table.empty()) {
        out.terms_ = entry.terms;
        out.vertical_frac_ = entry.vertical_transmittance_frac;
      } else {
        auto table = physics::AtmosphereTable::build(entry.table);
        if (!table) {
          return physics::make_error(physics::ErrorCode::config,
                                     fmt::format("band '{}': {}", out.name_, table.error().text));
        }
        out.table_ = std::move(*table);
      }
      break;
    }
  }
  out.place_m_ = scenario.place.height_m;
  out.fog_ = scenario.atmosphere.fog;
  if (out.fog_) {
    out.fog_optics_ = physics::fog_optics(*out.fog_, scene::spectral_band(scenario.bands[band]));
  }
  const auto air = physics::BandAir::build(scene::spectral_band(scenario.bands[band]));
  out.sun_outside_w_m2_ = air ? air->sun_outside_w_m2()
                              : out.black(physics::kSunTemperatureK) * physics::kPi *
                                    std::pow(std::sin(physics::kSunSemiAngleRad), 2);
  return out;
}

void BandRadiance::set_air(double air_k, const physics::SunPosition& sun, double beam_frac,
                           double beam_above_frac, const physics::SkyState& sky_now,
                           const UnderFog& under_fog) {
  air_k_ = air_k;
  air_ = black(air_k);
  parted_ = false;
  sky_now_ = sky_now;
  sky_air_ = black(air_k + sky_now.warmer_k);
  base_ = black(sky_now.cloud_base_k);
  const double sin_sun = std::sin(sun.elevation.value());
  double through = 0.0;
  if (column_) {
    const double to_sea_level = std::exp(place_m_ / physics::BandAir::kWarmthScaleM);
    warmer_k_ = (air_k - column_->at(place_m_).kelvin) * to_sea_level;
    sky_warmer_k_ = warmer_k_ + sky_now.warmer_k * to_sea_level;
    const double shown_rad = physics::apparent_elevation(sun.elevation).value();
    through = shown_rad > 0.0 ? air_terms_->transmittance(
                                    physics::AirPath::to_space(*column_, place_m_, shown_rad),
                                    physics::AirSource::sun_lowtran)
                              : 0.0;
    shine_.reset();
    if (scatter_ && shown_rad > 0.0 && beam_above_frac > 0.0) {
      const double per_au2 = 1.0 / (sun.distance_au * sun.distance_au);
      shine_ = {scatter_->beams(*column_, std::span(&shown_rad, 1)), sun.direction_enu,
                beam_frac * per_au2, beam_above_frac * per_au2};
    }
  } else {
    through = table_ ? table_->out(sin_sun).transmittance_frac
                     : std::pow(vertical_frac_, air_mass(sin_sun));
  }
  // Find the sky by elevation, and with its mean the light of the fog.
  const int rings = column_ ? 400 : 1000;
  constexpr int kSectors = 90;  // of half a turn
  const auto elevation_of = [rings](int i) { return (i + 0.5) / rings * physics::kPi / 2.0; };
  std::vector<double> ring_w_m2_sr;
  double level_w_m2_sr = 0.0;
  double level_weights = 0.0;
  for (int i = 0; i < rings; ++i) {
    const double elevation = elevation_of(i);
    // Take the phase functions' mean all around.
    physics::SunScatter::Kinds phase{};
    for (int k = 0; k < kSectors && shine_; ++k) {
      const double azimuth = (k + 0.5) / kSectors * physics::kPi;
      const double cosine =
          std::sin(elevation) * shine_->to_sun.z +
          std::cos(elevation) * std::hypot(shine_->to_sun.x, shine_->to_sun.y) * std::cos(azimuth);
      const auto one = scatter_->phase_per_sr(cosine);
      for (std::size_t j = 0; j < phase.size(); ++j) phase[j] += one[j] / kSectors;
    }
    ring_w_m2_sr.push_back(sky(0.0, std::sin(elevation), phase));
    const double weight = std::sin(elevation) * std::cos(elevation);
    level_w_m2_sr += weight * ring_w_m2_sr.back();
    level_weights += weight;
  }
  if (fog_) {
    fog_light_ = physics::fog_light(
        fog_optics_, fog_->top_m,
        {.black_w_m2_sr = air_,
         .sky_w_m2_sr = level_w_m2_sr / level_weights,
         .ground_w_m2_sr = black(under_fog.ground_k),
         .sun_w_m2 = sun_outside_w_m2_ / (sun.distance_au * sun.distance_au) * beam_frac * through,
         .sin_sun = std::sin(physics::apparent_elevation(sun.elevation).value())});
  }
  // Average the sky before faces of every tilt over elevation and azimuth, by the midpoint rule.
  std::array<double, kTiltSteps + 1> weights{};
  sky_means_.fill(0.0);
  for (int i = 0; i < rings; ++i) {
    const double elevation = elevation_of(i);
    const double radiance = through_fog(ring_w_m2_sr[static_cast<std::size_t>(i)], 0.0,
                                        {std::cos(elevation), 0.0, std::sin(elevation)});
    for (std::size_t t = 0; t <= kTiltSteps; ++t) {
      const double tilt = std::min(static_cast<double>(t) / kTiltSteps, 0.999) * physics::kPi;
      double cosines = 0.0;
      for (int k = 0; k < kSectors; ++k) {
        cosines += std::max(0.0, std::cos(tilt) * std::sin(elevation) +
                                     std::sin(tilt) * std::cos(elevation) *
                                         std::cos((k + 0.5) / kSectors * physics::kPi));
      }
      const double weight = cosines * std::cos(elevation);
      sky_means_[t] += weight * radiance;
      weights[t] += weight;
    }
  }
  for (std::size_t t = 0; t <= kTiltSteps; ++t) sky_means_[t] /= weights[t];
  sun_w_m2_ = sun_outside_w_m2_ / (sun.distance_au * sun.distance_au) * beam_frac *
              under_fog.beam_frac * through;
}

double BandRadiance::sky_mean(double normal_up) const noexcept {
  const double place = std::acos(std::clamp(normal_up, -1.0, 1.0)) / physics::kPi * kTiltSteps;
  const auto node = std::min(static_cast<std::size_t>(place), kTiltSteps - 1);
  return std::lerp(sky_means_[node], sky_means_[node + 1], place - static_cast<double>(node));
}

double BandRadiance::emissivity(const scene::Material& material) const {
  for (const scene::BandEmissivity& e : material.band_emissivity) {
    if (e.band == name_) return e.emissivity_frac;
  }
  return material.emissivity_frac;
}

physics::SunScatter::Kinds BandRadiance::scattered(const physics::AirPath& path,
                                                   double sensor_m) const {
  physics::SunScatter::Kinds light{};
  if (!shine_) return light;
  scatter_->scattered_w_m2(path, shine_->beams, std::span(&light, 1));
  const double share = sensor_m >= sky_now_.cloud_base_m ? shine_->above_frac : shine_->share_frac;
  for (double& x : light) x *= share;
  return light;
}

physics::FogStretch<double> BandRadiance::in_fog(double sensor_m, double sin_elevation,
                                                 double range_m) const noexcept {
  if (!fog_) return {0.0, 0.0};
  return physics::fog_stretch(fog_->top_m - sensor_m, sin_elevation, range_m);
}

double BandRadiance::through_fog(double clear_w_m2_sr, double sensor_m,
                                 const physics::FogStretch<double>& stretch,
                                 double extinction_per_m, const glm::dvec3& direction) const {
  const double through = std::exp(-extinction_per_m * stretch.length_m);
  const double glow =
      physics::fog_glow_w_m2_sr(fog_light_, extinction_per_m, std::max(fog_->top_m - sensor_m, 0.0),
                                direction.z, stretch.length_m);
  if (!(stretch.begin_m > 0.0)) return through * clear_w_m2_sr + glow;
  // See the fog through the air before it.
  const double path = through_air({0.0, 0.0, air_k_}, sensor_m, stretch.begin_m, direction);
  const double seen = through_air({glow, 0.0, air_k_}, sensor_m, stretch.begin_m, direction);
  return through * clear_w_m2_sr + seen - through * path;
}

double BandRadiance::at_aperture(const Leaving& leaving, double sensor_m, double range_m,
                                 const glm::dvec3& direction) const {
  const double clear_w_m2_sr = through_air(leaving, sensor_m, range_m, direction);
  const auto stretch = in_fog(sensor_m, direction.z, range_m);
  return stretch.length_m > 0.0 ? through_fog(clear_w_m2_sr, sensor_m, stretch,
                                              fog_optics_.extinction_per_m, direction)
                                : clear_w_m2_sr;
}

double BandRadiance::through_fog(double sky_w_m2_sr, double sensor_m,
                                 const glm::dvec3& direction) const {
  const auto stretch = in_fog(sensor_m, direction.z, physics::kFogFarM);
  return stretch.length_m > 0.0 ? through_fog(sky_w_m2_sr, sensor_m, stretch,
                                              fog_optics_.wide_extinction_per_m(), direction)
                                : sky_w_m2_sr;
}

double BandRadiance::through_air(const Leaving& leaving, double sensor_m, double range_m,
                                 const glm::dvec3& direction) const {
  const double sin_elevation = direction.z;
  if (column_) {
    const double height_m = place_m_ + sensor_m;
    const auto path =
        physics::AirPath::between(*column_, height_m, height_m + range_m * sin_elevation, range_m);
    const auto seen = air_terms_->evaluate<3, 1>(path, kSources, {warmer_k_});
    const auto& tau = seen.transmittance_frac;
    const double thermal = thermal_frac(tau, leaving.surface_k);
    double sum =
        thermal * leaving.thermal + tau[2] * leaving.sunlight + seen.path_radiance_w_m2_sr[0];
    if (shine_) {
      const auto light = scattered(path, sensor_m);
      const auto phase = scatter_->phase_per_sr(glm::dot(direction, shine_->to_sun));
      for (std::size_t k = 0; k < light.size(); ++k) sum += light[k] * phase[k];
    }
    return sum;
  }
  const double sum = leaving.thermal + leaving.sunlight;
  if (table_) {
    const auto air = table_->along(range_m, sin_elevation);
    return air.transmittance_frac * sum + air.path_radiance_w_m2_sr;
  }
  // Sum the transmittance of the terms; the air radiates with the rest.
  double tau = terms_.empty() ? 1.0 : 0.0;
  for (const scene::AtmosphereTerm& term : terms_) {
    tau += term.amplitude_frac * std::exp(-term.extinction_per_km * range_m * 1e-3);
  }
  return tau * sum + (1.0 - tau) * air_;
}

double BandRadiance::sky(double sensor_m, const glm::dvec3& direction) const {
  physics::SunScatter::Kinds phase{};
  if (shine_) phase = scatter_->phase_per_sr(glm::dot(direction, shine_->to_sun));
  return sky(sensor_m, direction.z, phase);
}

double BandRadiance::sky(double sensor_m, double sin_elevation,
                         const physics::SunScatter::Kinds& phase_per_sr) const {
  if (!has_air_) return 0.0;
  double clear_w_m2_sr = 0.0;
  double cover = parted_ ? 0.0 : sky_now_.cloud_cover_frac;
  if (column_) {
    const auto path = physics::AirPath::to_space(*column_, place_m_ + sensor_m,
                                                 std::asin(std::clamp(sin_elevation, -1.0, 1.0)));
    clear_w_m2_sr = air_terms_->path_radiance_w_m2_sr(path, sky_warmer_k_);
    const auto light = scattered(path, sensor_m);
    for (std::size_t k = 0; k < light.size(); ++k) clear_w_m2_sr += light[k] * phase_per_sr[k];
  } else if (table_) {
    clear_w_m2_sr = table_->out(sin_elevation).path_radiance_w_m2_sr;
  } else {
    clear_w_m2_sr = sky_air_ * (1.0 - std::pow(vertical_frac_, air_mass(sin_elevation)));
  }
  if (sensor_m >= sky_now_.cloud_base_m) cover = 0.0;
  return cover > 0.0 ? (1.0 - cover) * clear_w_m2_sr + cover * cloud(sensor_m, sin_elevation)
                     : clear_w_m2_sr;
}

double BandRadiance::cloud(double sensor_m, double sin_elevation) const {
  if (!has_air_) return 0.0;
  const double above_m = std::max(sky_now_.cloud_base_m - sensor_m, 1.0);
  // Follow the ray to the base, or from where it just passes the ground.
  const double eye_m = std::max(place_m_ + sensor_m, 0.0);
  const double grazing = physics::kCloudEarthRadiusM / (physics::kCloudEarthRadiusM + eye_m);
  const double sine = std::max(sin_elevation, -std::sqrt(1.0 - grazing * grazing));
  const double along_m = physics::kCloudEarthRadiusM * sine;
  const double range_m =
      std::sqrt(along_m * along_m + above_m * (2.0 * physics::kCloudEarthRadiusM + above_m)) -
      along_m;
  if (column_) {
    const auto seen = air_terms_->evaluate<3, 1>(
        physics::AirPath::between(*column_, place_m_ + sensor_m, place_m_ + sky_now_.cloud_base_m,
                                  range_m),
        kSources, {sky_warmer_k_});
    return thermal_frac(seen.transmittance_frac, sky_now_.cloud_base_k) * base_ +
           seen.path_radiance_w_m2_sr[0];
  }
  if (table_) {
    const auto air = table_->along(range_m, sin_elevation);
    return air.transmittance_frac * base_ + air.path_radiance_w_m2_sr;
  }
  const double through = std::pow(vertical_frac_, air_mass(sin_elevation));
  return through * base_ + (1.0 - through) * sky_air_;
}

double BandRadiance::to_space(double sensor_m, double sin_elevation,
                              physics::AirSource source) const {
  const double fog_frac = std::exp(-fog_optics_.extinction_per_m *
                                   in_fog(sensor_m, sin_elevation, physics::kFogFarM).length_m);
  if (column_) {
    const double elevation_rad = std::asin(std::clamp(sin_elevation, -1.0, 1.0));
    return fog_frac *
           air_terms_->transmittance(
               physics::AirPath::to_space(*column_, place_m_ + sensor_m, elevation_rad), source);
  }
  if (table_) return fog_frac * table_->out(sin_elevation).transmittance_frac;
  return fog_frac * (has_air_ ? std::pow(vertical_frac_, air_mass(sin_elevation)) : 1.0);
}

double BandRadiance::sun_disc(double beam_frac, double sensor_m, double sin_elevation) const {
  const double solid_angle_cosine_sr =
      physics::kPi * std::pow(std::sin(physics::kSunSemiAngleRad), 2);
  return sun_outside_w_m2_ * beam_frac / solid_angle_cosine_sr *
         to_space(sensor_m, sin_elevation, physics::AirSource::sun_lowtran);
}

double BandRadiance::moon(double kelvin, double sun_cosine, double sun_au, double sensor_m,
                          double sin_elevation) const {
  const double clear = has_air_ && !parted_ && sensor_m < sky_now_.cloud_base_m
                           ? 1.0 - sky_now_.cloud_cover_frac
                           : 1.0;
  const double sunlight = sun_outside_w_m2_ / (sun_au * sun_au) * sun_cosine;
  return clear * to_space(sensor_m, sin_elevation, physics::AirSource::black_300k) *
         (physics::kMoonEmissivityFrac * black(kelvin) +
          (1.0 - physics::kMoonEmissivityFrac) * sunlight / physics::kPi);
}

}  // namespace emit::reference
