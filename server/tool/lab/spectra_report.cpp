// SPDX-License-Identifier: Apache-2.0
#include "tool/lab/spectra_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

using scene::Material;

/// Middle of a built-in band, where diagrams show it.
struct BuiltIn {
  std::string_view name;
  double middle_um;
};
constexpr std::array<BuiltIn, 4> kBuiltIn{
    {{"3-5", 4.0}, {"3.4-4.1", 3.75}, {"8-12", 10.0}, {"7.7-9.3", 8.5}}};

}  // namespace

const scene::FoldedBand* folded_band(const Material& material, const std::string& band) {
  const auto& bands = material.emissivity_spectrum.bands;
  const auto found = std::ranges::find(bands, band, &scene::FoldedBand::band);
  return found != bands.end() ? &*found : nullptr;
}

bool not_covered(const Material& material, const std::string& band) {
  return !material.emissivity_spectrum.samples.empty() && !folded_band(material, band) &&
         std::ranges::find(material.band_emissivity, band, &scene::BandEmissivity::band) ==
             material.band_emissivity.end();
}

std::string spectrum_text(const Material& material) {
  const auto& samples = material.emissivity_spectrum.samples;
  if (samples.empty()) return "-";
  return fmt::format("{:g} to {:g} um", samples.front().wavelength_um,
                     samples.back().wavelength_um);
}

void print_spectra(std::FILE* out, std::span<const Material> materials) {
  bool any = false;
  TextTable table({"spectrum", "band um", "emissivity", "beyond", "by temperature K", "by air K",
                   "together K", "full sun K"});
  for (const Material& material : materials) {
    const scene::EmissivitySpectrum& spectrum = material.emissivity_spectrum;
    for (const scene::FoldedBand& band : spectrum.bands) {
      any = true;
      table.add({material.name, band.band, fmt::format("{:.4f}", band.emissivity_frac),
                 fmt::format("{:.1f} %", 100.0 * band.beyond_frac),
                 fmt::format("{:.2f}", band.temperature_k), fmt::format("{:.2f}", band.air_k),
                 fmt::format("{:.2f}", band.largest_k), fmt::format("{:.2f}", band.sunlight_k)});
    }
    if (!spectrum.total) continue;
    any = true;
    table.add({material.name, "total", fmt::format("{:.4f}", spectrum.total->emissivity_frac),
               fmt::format("{:.1f} %", 100.0 * spectrum.total->beyond_frac), "", "", "", ""});
  }
  if (!any) return;
  fmt::print(out, "{}", table.to_string());
  fmt::print(out,
             "folded behind 1 km of mid-latitude summer air at 300 K, or at the prescribed "
             "temperature; errors from 250 to 350 K, over 0 to 5 km of air, and of reflected "
             "sunlight, in apparent temperature\n");
}

Json spectrum_json(const scene::EmissivitySpectrum& spectrum) {
  Json wavelengths = Json::array();
  Json emissivities = Json::array();
  for (const scene::EmissivitySample& sample : spectrum.samples) {
    wavelengths.push(sample.wavelength_um);
    emissivities.push(sample.emissivity_frac);
  }
  Json bands = Json::object();
  for (const scene::FoldedBand& band : spectrum.bands) {
    bands.set(band.band, Json::object()
                             .set("emissivity_frac", band.emissivity_frac)
                             .set("beyond_frac", band.beyond_frac)
                             .set("temperature_error_k", band.temperature_k)
                             .set("air_error_k", band.air_k)
                             .set("largest_error_k", band.largest_k)
                             .set("sunlight_error_k", band.sunlight_k));
  }
  Json out = Json::object();
  out.set("wavelength_um", std::move(wavelengths)).set("emissivity_frac", std::move(emissivities));
  out.set("reference_k", spectrum.reference_k).set("bands", std::move(bands));
  if (spectrum.total) {
    out.set("total", Json::object()
                         .set("emissivity_frac", spectrum.total->emissivity_frac)
                         .set("beyond_frac", spectrum.total->beyond_frac));
  }
  return out;
}

Plot spectrum_plot(std::span<const Material> materials, const std::string& family) {
  Plot plot{.title = fmt::format("{}: emissivity over wavelength", family),
            .x = {.label = "wavelength, um", .scale = PlotScale::logarithmic},
            .y = {.label = "emissivity; dots: folded over a band"},
            .series = {}};
  for (const Material& material : materials) {
    PlotSeries line{.label = material.name, .points = {}, .line = true, .markers = false};
    for (const scene::EmissivitySample& sample : material.emissivity_spectrum.samples) {
      line.points.push_back({sample.wavelength_um, sample.emissivity_frac, {}});
    }
    if (line.points.empty()) continue;
    plot.series.push_back(std::move(line));
    PlotSeries dots{.label = material.name + ", bands", .points = {}};
    for (const scene::FoldedBand& band : material.emissivity_spectrum.bands) {
      const auto place = std::ranges::find(kBuiltIn, band.band, &BuiltIn::name);
      if (place == kBuiltIn.end()) continue;
      dots.points.push_back({place->middle_um, band.emissivity_frac,
                             fmt::format("{} {} um: {:.4f}, error {:.2f} K", material.name,
                                         band.band, band.emissivity_frac, band.largest_k)});
    }
    plot.series.push_back(std::move(dots));
  }
  return plot;
}

}  // namespace emit::tool
