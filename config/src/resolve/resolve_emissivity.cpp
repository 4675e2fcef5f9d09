// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "emit/physics/constants.hpp"
#include "emit/physics/surface/emissivity_spectrum.hpp"
#include "resolve.hpp"

namespace emit::config {
namespace {

using physics::EmissivityFold;
using physics::Kelvin;
using scene::EmissivitySpectrum;
using scene::Material;
using scene::SpectralBand;

/// Level path at the place behind which emissivities are folded, and the longest one that they are
/// judged over, m.
constexpr double kFoldedPathM = 1000.0;
constexpr double kLongestPathM = 5000.0;
/// Elevation of the sun in the judgement of reflected sunlight.
constexpr double kJudgedSunRad = 45.0 * physics::kDegree;
/// Air that passes less than this share of a band leaves nothing to weight.
constexpr double kOpaqueFrac = 1e-3;
/// A spectrum that misses more of a band's weight than this is worth a warning.
constexpr double kBeyondFrac = 0.05;
/// An error above this is worth a warning, K.
constexpr double kErrorK = 0.2;
/// Least share of a blackbody's spectrum that gives the total emissivity.
constexpr double kTotalCoveredFrac = 0.6;
constexpr double kLeastTotalFrac = 0.01;

/// Sets the temperatures of a material that its parts and itself state.
void set_temperatures(const Material& material, const scene::ScenarioDesc& scenario,
                      EmissivitySpectrum& spectrum) {
  std::vector<double> hot_k;
  if (material.prescribed_k) hot_k.push_back(*material.prescribed_k);
  std::vector<double> cold_k;
  for (const scene::ObjectDesc& object : scenario.objects) {
    for (const scene::PartDesc& part : object.parts) {
      if (part.material != material.name) continue;
      if (part.curve.given) {
        hot_k.insert(hot_k.end(), {part.curve.idle_k, part.curve.full_k});
        cold_k.push_back(part.curve.cold_k);
      }
      for (const scene::TimedPartCommand& timed : part.commands) {
        if (timed.command.kind == scene::PartCommand::Kind::temperature) {
          hot_k.push_back(timed.command.value);
        }
      }
    }
  }
  if (hot_k.empty()) return;
  const auto [least, greatest] = std::ranges::minmax(hot_k);
  spectrum.reference_k = 0.5 * (least + greatest);
  hot_k.insert(hot_k.end(), cold_k.begin(), cold_k.end());
  spectrum.least_k = std::ranges::min(hot_k);
  spectrum.greatest_k = std::ranges::max(hot_k);
}

/// Returns the built-in air of a band: its own, or that of place and date where the scenario states
/// the air of the band without its spectrum. Nothing where pictures have no air.
std::optional<physics::AirSpec> air_of(const SpectralBand& band,
                                       const scene::ScenarioDesc& scenario) {
  if (!scenario.atmosphere.enabled || !physics::BandAir::covers(scene::spectral_band(band))) {
    return std::nullopt;
  }
  const auto own =
      std::ranges::find(scenario.atmosphere.bands, band.name, &scene::BandAtmosphere::band);
  if (own == scenario.atmosphere.bands.end()) return physics::AirSpec{};
  return own->model ? own->model : built_in_air(AtmosphereDraft{}, scenario);
}

physics::JudgedAir judged_air(const physics::AirSpec& spec, double height_m) {
  const auto column = physics::AirColumn::build(spec);
  if (!column) return {};
  const auto level = [&](double range_m) {
    return physics::SpectralAir(physics::AirPath::between(*column, height_m, height_m, range_m));
  };
  return {level(kFoldedPathM), level(kLongestPathM),
          physics::SpectralAir(physics::AirPath::to_space(*column, height_m, kJudgedSunRad))};
}

std::vector<physics::EmissivityPoint> points_of(const EmissivitySpectrum& spectrum) {
  std::vector<physics::EmissivityPoint> out;
  for (const auto& [wavelength_um, emissivity_frac] : spectrum.samples) {
    out.push_back({wavelength_um, emissivity_frac});
  }
  return out;
}

std::string span_of(const EmissivitySpectrum& spectrum) {
  return fmt::format("{:g} to {:g} um", spectrum.samples.front().wavelength_um,
                     spectrum.samples.back().wavelength_um);
}

/// Folds one band, and judges the result.
scene::FoldedBand fold_band(const EmissivitySpectrum& spectrum, const SpectralBand& band,
                            physics::JudgedAir air) {
  const std::vector<physics::EmissivityPoint> points = points_of(spectrum);
  const Kelvin reference(spectrum.reference_k);
  const EmissivityFold fold(points, scene::spectral_band(band), Kelvin(spectrum.least_k));
  if (fold.black_w_m2_sr(reference, air.folded) < kOpaqueFrac * fold.black_w_m2_sr(reference)) {
    air.folded = {};
  }
  const EmissivityFold::Folded folded = fold.at(reference, air.folded);
  const physics::EmissivityErrors errors = physics::emissivity_errors(
      fold, folded.emissivity_frac,
      {reference, Kelvin(spectrum.least_k), Kelvin(spectrum.greatest_k)}, air);
  return {.band = band.name,
          .emissivity_frac = folded.emissivity_frac,
          .beyond_frac = folded.beyond_frac,
          .temperature_k = errors.temperature_k,
          .air_k = errors.air_k,
          .largest_k = errors.largest_k,
          .sunlight_k = errors.sunlight_k};
}

/// Folds the total emissivity of a material that does not state it.
void fold_total(Material& material, const Node& node, Diagnostics& diagnostics) {
  EmissivitySpectrum& spectrum = material.emissivity_spectrum;
  if (node.has("emissivity_frac")) return;
  if (material.gloss) {
    diagnostics.add(node.at,
                    "key 'emissivity_frac' is missing: with 'gloss' a spectrum is that along the "
                    "normal, and the total emissivity is hemispherical");
    return;
  }
  const EmissivityFold::Folded total =
      physics::total_emissivity(points_of(spectrum), Kelvin(spectrum.reference_k));
  if (1.0 - total.beyond_frac < kTotalCoveredFrac) {
    diagnostics.add(
        node.at, fmt::format("key 'emissivity_frac' is missing: the spectrum ({}) covers {:.0f} % "
                             "of what a blackbody of {:g} K emits, and {:.0f} % are needed",
                             span_of(spectrum), 100.0 * (1.0 - total.beyond_frac),
                             spectrum.reference_k, 100.0 * kTotalCoveredFrac));
    return;
  }
  if (total.emissivity_frac < kLeastTotalFrac) {
    diagnostics.add(node.at, fmt::format("key 'emissivity_frac' is missing: the total emissivity "
                                         "of the spectrum is {:.4f}, must be {} .. 1",
                                         total.emissivity_frac, kLeastTotalFrac));
    return;
  }
  spectrum.total = {total.emissivity_frac, total.beyond_frac};
  material.emissivity_frac = total.emissivity_frac;
}

std::string percent(double frac) {
  return fmt::format("{:.{}f} %", 100.0 * frac, frac < 0.0995 ? 1 : 0);
}

/// Says what a folded emissivity leaves open.
void warn_of(const Material& material, const scene::FoldedBand& band, const std::string& file,
             std::vector<std::string>& warnings) {
  const EmissivitySpectrum& spectrum = material.emissivity_spectrum;
  const std::string head =
      fmt::format("{}: material '{}', band '{}': ", file, material.name, band.band);
  if (band.beyond_frac > kBeyondFrac) {
    warnings.push_back(
        fmt::format("{}{} of the weight lies beyond the spectrum ({}), whose end "
                    "values count there",
                    head, percent(band.beyond_frac), span_of(spectrum)));
  }
  if (band.largest_k > kErrorK) {
    const std::string range =
        spectrum.least_k < spectrum.greatest_k
            ? fmt::format("{:g} to {:g} K", spectrum.least_k, spectrum.greatest_k)
            : fmt::format("{:g} K", spectrum.least_k);
    warnings.push_back(fmt::format(
        "{}the emissivity {:.4f} folded from the spectrum at {:g} K shows up to {:.2f} K too much "
        "or too little, over {} and {:g} km of air (temperature {:.2f} K, air {:.2f} K)",
        head, band.emissivity_frac, spectrum.reference_k, band.largest_k, range,
        1e-3 * kLongestPathM, band.temperature_k, band.air_k));
  }
  if (band.sunlight_k > kErrorK) {
    warnings.push_back(
        fmt::format("{}the emissivity {:.4f} folded from the spectrum reflects full sunlight up to "
                    "{:.2f} K too bright or too dark",
                    head, band.emissivity_frac, band.sunlight_k));
  }
}

}  // namespace

void fold_spectra(const std::vector<Node>& nodes, const scene::ScenarioDesc& scenario,
                  UncoveredBand uncovered, std::vector<Material>& materials,
                  std::vector<std::string>& warnings, Diagnostics& diagnostics) {
  const bool any = std::ranges::any_of(
      materials, [](const Material& m) { return !m.emissivity_spectrum.samples.empty(); });
  // Faulty bands and spectra have no integrals.
  if (!any || !diagnostics.empty()) return;
  std::vector<physics::JudgedAir> airs;
  for (const SpectralBand& band : scenario.bands) {
    const std::optional<physics::AirSpec> spec = air_of(band, scenario);
    airs.push_back(spec ? judged_air(*spec, scenario.place.height_m) : physics::JudgedAir{});
  }
  const std::string file = scenario.file.string();
  for (std::size_t i = 0; i < materials.size(); ++i) {
    Material& material = materials[i];
    EmissivitySpectrum& spectrum = material.emissivity_spectrum;
    if (spectrum.samples.empty()) continue;
    set_temperatures(material, scenario, spectrum);
    fold_total(material, nodes[i], diagnostics);
    if (spectrum.total && spectrum.total->beyond_frac > kBeyondFrac) {
      warnings.push_back(fmt::format(
          "{}: material '{}': {} of the total emissivity's weight lies beyond the spectrum ({}), "
          "whose end values count there: {:.4f}, unless 'emissivity_frac' states it",
          file, material.name, percent(spectrum.total->beyond_frac), span_of(spectrum),
          spectrum.total->emissivity_frac));
    }
    for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
      const SpectralBand& band = scenario.bands[b];
      if (std::ranges::find(material.band_emissivity, band.name, &scene::BandEmissivity::band) !=
          material.band_emissivity.end()) {
        continue;
      }
      scene::FoldedBand folded = fold_band(spectrum, band, airs[b]);
      if (folded.beyond_frac >= 1.0) {
        if (uncovered == UncoveredBand::skip) continue;
        const char* key = nodes[i].has("emissivity_spectrum") ? "emissivity_spectrum"
                                                              : "emissivity_spectrum_file";
        diagnostics.add(
            key_location(nodes[i], key),
            fmt::format("'{}' ({}) has nothing of band '{}': extend it, or list the band in "
                        "'band_emissivity_frac'",
                        key, span_of(spectrum), band.name));
        continue;
      }
      warn_of(material, folded, file, warnings);
      material.band_emissivity.push_back({band.name, folded.emissivity_frac});
      spectrum.bands.push_back(std::move(folded));
    }
  }
}

}  // namespace emit::config
