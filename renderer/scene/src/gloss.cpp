// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/gloss_optics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/weather.hpp"

namespace emit::scene {
namespace {

using physics::Kelvin;

constexpr Kelvin kSurface(300.0);
/// Emissivities may be that much above what the interface lets through, because both are rounded.
constexpr double kNormalSlackFrac = 0.02;
constexpr double kHemisphericalSlackFrac = 0.03;
/// Wavelengths that hold nearly all that a surface at 300 K emits.
const physics::Band kThermal{3.0, 50.0, {}};

/// Reflectance of a table by angle, linear in the angle.
double by_angle_frac(const Gloss& gloss, double cosine) {
  const double angle = std::acos(std::clamp(cosine, 0.0, 1.0));
  const auto after = std::ranges::upper_bound(gloss.angle_rad, angle);
  const auto i = static_cast<std::size_t>(after - gloss.angle_rad.begin());
  // All surfaces are mirrors at 90 degrees.
  const bool last = i == gloss.angle_rad.size();
  const double low_rad = gloss.angle_rad[i - 1];
  const double high_rad = last ? physics::kPi / 2.0 : gloss.angle_rad[i];
  const double high_frac = last ? 0.0 : gloss.angle_emissivity_frac[i];
  const double share = std::min((angle - low_rad) / (high_rad - low_rad), 1.0);
  return 1.0 - std::lerp(gloss.angle_emissivity_frac[i - 1], high_frac, share);
}

std::optional<double> listed_emissivity(const Material& material, const std::string& band) {
  for (const BandEmissivity& entry : material.band_emissivity) {
    if (entry.band == band) return entry.emissivity_frac;
  }
  return std::nullopt;
}

}  // namespace

std::vector<physics::OpticalConstants> constants_of(const Gloss& gloss) {
  const auto built_in = physics::optical_constants(gloss.index);
  std::vector<physics::OpticalConstants> out(built_in.begin(), built_in.end());
  for (std::size_t i = 0; i < gloss.wavelength_um.size(); ++i) {
    out.push_back({gloss.wavelength_um[i], gloss.refractive_index[i], gloss.extinction_index[i]});
  }
  return out;
}

physics::LobeCurve interface_reflectance_frac(const Gloss& gloss, const physics::Band& band,
                                              Kelvin source) {
  const auto constants = constants_of(gloss);
  physics::LobeCurve out{};
  for (std::size_t i = 0; i < physics::kLobeNodes; ++i) {
    const double cosine = physics::lobe_cosine(i);
    out[i] = constants.empty() ? by_angle_frac(gloss, cosine)
                               : physics::band_reflectance_frac(constants, band, source, cosine);
  }
  return out;
}

physics::Result<void> validate(const Gloss& gloss) {
  const auto fail = [](std::string text) {
    return physics::make_error(physics::ErrorCode::invalid_argument, std::move(text));
  };
  const bool built_in = gloss.index != physics::IndexTable::none;
  const bool own = !gloss.wavelength_um.empty() || !gloss.refractive_index.empty() ||
                   !gloss.extinction_index.empty();
  const bool by_angle = !gloss.angle_rad.empty() || !gloss.angle_emissivity_frac.empty();
  if (built_in + own + by_angle != 1) {
    return fail(
        "'gloss' needs one of: 'index'; 'wavelength_um', 'refractive_index' and "
        "'extinction_index'; 'angle_deg' and 'angle_emissivity_frac'");
  }
  if (own) {
    if (gloss.refractive_index.size() != gloss.wavelength_um.size() ||
        gloss.extinction_index.size() != gloss.wavelength_um.size()) {
      return fail("'wavelength_um', 'refractive_index' and 'extinction_index' differ in length");
    }
    return physics::validate(constants_of(gloss));
  }
  if (!by_angle) return {};
  if (gloss.angle_rad.size() != gloss.angle_emissivity_frac.size()) {
    return fail("'angle_deg' and 'angle_emissivity_frac' differ in length");
  }
  if (gloss.angle_rad.front() != 0.0) return fail("'angle_deg' must begin with 0");
  for (std::size_t i = 1; i < gloss.angle_rad.size(); ++i) {
    if (!(gloss.angle_rad[i] > gloss.angle_rad[i - 1])) return fail("'angle_deg' must ascend");
  }
  if (!(gloss.angle_rad.back() < physics::kPi / 2.0)) return fail("'angle_deg' must end below 90");
  return {};
}

physics::Result<void> check_emissivities(const Material& material, const physics::Facets& facets,
                                         const std::vector<SpectralBand>& bands) {
  const auto fail = [&](std::string text) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               fmt::format("material '{}': {}", material.name, text));
  };
  for (const SpectralBand& band : bands) {
    const auto listed = listed_emissivity(material, band.name);
    if (!listed) continue;
    const auto reflectance =
        interface_reflectance_frac(*material.gloss, spectral_band(band), kSurface);
    // Compare with a smooth interface first: rough facets let more through, and their integral
    // takes milliseconds.
    if (*listed <= 1.0 - reflectance.back() + kNormalSlackFrac) continue;
    const double most = physics::passed_frac(facets, reflectance).back();
    if (*listed > most + kNormalSlackFrac) {
      return fail(fmt::format(
          "its emissivity of {:.3f} in band '{}' is more than the interface of 'gloss' lets "
          "through along the normal, {:.3f}",
          *listed, band.name, most));
    }
  }
  const physics::LobeCurve reflectance =
      interface_reflectance_frac(*material.gloss, kThermal, kSurface);
  const double smooth = 1.0 - physics::hemispherical_mean(reflectance);
  if (material.emissivity_frac <= smooth + kHemisphericalSlackFrac) return {};
  const double most = physics::hemispherical_mean(physics::passed_frac(facets, reflectance));
  if (material.emissivity_frac > most + kHemisphericalSlackFrac) {
    return fail(fmt::format(
        "'emissivity_frac' of {:.3f}, which the heat balance uses, is more than the interface of "
        "'gloss' lets through over the hemisphere, {:.3f}",
        material.emissivity_frac, most));
  }
  return {};
}

physics::Facets facets_of(const Material& material, const ScenarioDesc& scenario) {
  EMIT_CHECK(material.gloss.has_value());
  const Gloss& gloss = *material.gloss;
  if (!gloss.sea) return {physics::FacetSlopes::ggx, gloss.facet_slope};
  return {physics::FacetSlopes::gaussian, std::sqrt(physics::sea_mean_square_slope(std::min(
                                              sea_wind_m_s(gloss, scenario), kMostSeaWindMS)))};
}

double sea_wind_m_s(const Gloss& gloss, const ScenarioDesc& scenario) {
  const bool table = !scenario.weather.empty();
  return gloss.sea_wind_m_s.value_or(table
                                         ? physics::forcing_from_rows(scenario.weather, 0).wind_m_s
                                         : scenario.clear_sky.wind_m_s);
}

physics::FacetOptics facet_optics(const Material& material, const physics::Facets& facets,
                                  const SpectralBand& band) {
  EMIT_CHECK(material.gloss.has_value());
  const physics::Band spectral = spectral_band(band);
  physics::FacetOptics out;
  out.reflectance_frac = interface_reflectance_frac(*material.gloss, spectral, kSurface);
  out.sun_reflectance_frac =
      interface_reflectance_frac(*material.gloss, spectral, Kelvin(physics::kSunTemperatureK));
  out.lobe_frac = material.gloss->lobe_frac;
  const auto listed = listed_emissivity(material, band.name);
  const physics::LobeCurve all = physics::passed_frac(facets, out.reflectance_frac);
  const double passed = listed ? all.back() : physics::hemispherical_mean(all);
  const double emitted = listed.value_or(material.emissivity_frac);
  out.body_absorptance_frac = passed > 0.0 ? std::min(1.0, emitted / passed) : 1.0;
  return out;
}

}  // namespace emit::scene
