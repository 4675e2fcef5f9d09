// SPDX-License-Identifier: Apache-2.0
#include "tool/lab/materials_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "emit/scene/melting.hpp"
#include "tool/lab/spectra_report.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

using scene::Material;

constexpr double kZeroCelsiusK = 273.15;
constexpr double kHourS = 3600.0;
constexpr std::array<const char*, scene::kRoughnesses> kRoughnesses{
    "very rough", "rough", "medium rough", "medium smooth", "smooth", "very smooth", "open water"};
constexpr std::array<const char*, 4> kBases{"ground", "air", "room", "body"};

constexpr std::array<const char*, 4> kBands{"3-5", "3.4-4.1", "8-12", "7.7-9.3"};

double of_band(const std::vector<scene::BandEmissivity>& bands, const std::string& name,
               double otherwise) {
  const auto found = std::ranges::find(bands, name, &scene::BandEmissivity::band);
  return found != bands.end() ? found->emissivity_frac : otherwise;
}

double emissivity_of(const Material& material, const std::string& band) {
  return of_band(material.band_emissivity, band, material.emissivity_frac);
}

/// Returns half the width of the range of an emissivity; 0 if it is not stated.
double emissivity_spread(const Material& material, const std::string& band) {
  if (!material.spread) return 0.0;
  return of_band(material.spread->band_emissivity, band, material.spread->emissivity_frac);
}

double resistance_m2k_w(const Material& material) {
  double sum = 0.0;
  for (const scene::Layer& layer : material.layers) {
    sum += layer.thickness_m / layer.conductivity_w_m_k;
  }
  return sum;
}

double heat_capacity_j_m2_k(const Material& material) {
  double sum = 0.0;
  for (const scene::Layer& layer : material.layers) {
    sum += layer.thickness_m * layer.density_kg_m3 * layer.specific_heat_j_kg_k;
  }
  return sum;
}

/// Returns the thermal inertia of the first layer, J m-2 K-1 s-1/2.
double inertia(const Material& material) {
  const scene::Layer& layer = material.layers.front();
  return std::sqrt(layer.conductivity_w_m_k * layer.density_kg_m3 * layer.specific_heat_j_kg_k);
}

std::string with_spread(double value, double half) {
  return half > 0.0 ? fmt::format("{:.2f} +-{:.2f}", value, half) : fmt::format("{:.2f}", value);
}

/// Wetness and resistances in s/m of a moist material.
std::string evaporation_text(const Material& material) {
  const physics::MoistSurface water = scene::moisture_of(material);
  const physics::WaterStore store = scene::water_store_of(material);
  const std::string rain = store.none() ? "" : fmt::format("{:.3g} mm of rain", store.capacity_mm);
  if (water.dry()) return rain.empty() ? "-" : rain;
  std::string text = fmt::format("{:.3g} of full", water.wetness_frac);
  if (water.resistance_s_m > 0.0) {
    text += fmt::format(", {:.0f} s/m", water.resistance_s_m);
    if (water.night_resistance_s_m > water.resistance_s_m) {
      text += fmt::format(", night {:.0f}", water.night_resistance_s_m);
    }
  }
  return rain.empty() ? text : text + ", " + rain;
}

std::string share_text(double half) {
  return half > 0.0 ? fmt::format("+-{:.0f} %", 100.0 * half) : "-";
}

/// Coldest and warmest temperature of a day.
struct Extremes {
  double least_k = 0.0;
  double greatest_k = 0.0;
};
Extremes extremes_of(const MaterialEntry& entry) {
  const auto [least, greatest] =
      std::ranges::minmax_element(entry.day, {}, &reference::CoursePoint::reference_k);
  return {least->reference_k, greatest->reference_k};
}

/// Returns indices of the entries of a family; every entry has one, which may be empty.
std::vector<std::size_t> members_of(std::span<const MaterialEntry> entries,
                                    const std::string& family) {
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].material.family == family) members.push_back(i);
  }
  return members;
}

std::vector<Material> materials_of(std::span<const MaterialEntry> entries) {
  std::vector<Material> out;
  for (const MaterialEntry& entry : entries) out.push_back(entry.material);
  return out;
}

std::string family_name(const std::string& family) {
  return family.empty() ? "without a family" : family;
}

/// Emissivity of a band, with its range or with the error of the folding.
std::string band_text(const Material& material, const std::string& band) {
  if (not_covered(material, band)) return "not in spectrum";
  const double value = emissivity_of(material, band);
  if (const scene::FoldedBand* folded = folded_band(material, band)) {
    return fmt::format("{:.3f}, {:.2f} K", value, folded->largest_k);
  }
  return with_spread(value, emissivity_spread(material, band));
}

/// Adds the rows of one comparison table.
void add_rows(TextTable& table, std::span<const MaterialEntry> entries) {
  const auto row = [&](const std::string& what, const auto& text) {
    std::vector<std::string> cells{what};
    for (const MaterialEntry& entry : entries) cells.push_back(text(entry));
    table.add(std::move(cells));
  };
  /// A row about layers, which parts of a given temperature do not have.
  const auto layer_row = [&](const std::string& what, const auto& text) {
    row(what, [&](const MaterialEntry& entry) {
      return entry.material.layers.empty() ? std::string("-") : text(entry.material);
    });
  };
  row("family", [](const MaterialEntry& e) { return family_name(e.material.family); });
  row("solar absorptance", [](const MaterialEntry& e) {
    const Material& m = e.material;
    return with_spread(m.solar_absorptance_frac, m.spread ? m.spread->solar_absorptance_frac : 0.0);
  });
  row("emissivity", [](const MaterialEntry& e) {
    const Material& m = e.material;
    return with_spread(m.emissivity_frac, m.spread ? m.spread->emissivity_frac : 0.0);
  });
  for (const char* band : kBands) {
    row(fmt::format("  {} um", band),
        [&](const MaterialEntry& e) { return band_text(e.material, band); });
  }
  row("  spectrum", [](const MaterialEntry& e) { return spectrum_text(e.material); });
  row("roughness", [](const MaterialEntry& e) {
    const Material& m = e.material;
    if (m.leaf_width_m) {
      return fmt::format("leaves {:.3g} m, x {:g}", *m.leaf_width_m,
                         m.leaf_area_index.value_or(2.0));
    }
    return std::string(kRoughnesses.at(static_cast<std::size_t>(m.roughness)));
  });
  layer_row("base", [](const Material& m) {
    const std::string kind = kBases.at(static_cast<std::size_t>(m.base));
    return m.base_stated ? fmt::format("{} {:.1f} K", kind, m.base_k) : kind;
  });
  layer_row("layers", [](const Material& m) { return std::to_string(m.layers.size()); });
  layer_row("resistance m2 K/W",
            [](const Material& m) { return fmt::format("{:.3g}", resistance_m2k_w(m)); });
  layer_row("  conductivity", [](const Material& m) {
    return share_text(m.spread ? m.spread->conductivity_frac : 0.0);
  });
  layer_row("capacity kJ/m2/K", [](const Material& m) {
    return fmt::format("{:.3g}", 1e-3 * heat_capacity_j_m2_k(m));
  });
  layer_row("  its uncertainty", [](const Material& m) {
    return share_text(m.spread ? m.spread->heat_capacity_frac : 0.0);
  });
  layer_row("inertia of 1st layer",
            [](const Material& m) { return fmt::format("{:.0f}", inertia(m)); });
  layer_row("layers hold",
            [](const Material& m) { return std::string(m.dry_layers_valid ? "yes" : "no"); });
  layer_row("evaporation", [](const Material& m) { return evaporation_text(m); });
  layer_row("fit RMS / max K", [](const Material& m) {
    return m.foster_fit ? fmt::format("{:.3f} / {:.3f}", m.foster_fit->rms_k, m.foster_fit->max_k)
                        : std::string("not fitted");
  });
  row("day, coldest C", [](const MaterialEntry& e) {
    return e.day.empty() ? std::string("-")
                         : fmt::format("{:.1f}", extremes_of(e).least_k - kZeroCelsiusK);
  });
  row("day, warmest C", [](const MaterialEntry& e) {
    return e.day.empty() ? std::string("-")
                         : fmt::format("{:.1f}", extremes_of(e).greatest_k - kZeroCelsiusK);
  });
}

Json bands_json(const std::vector<scene::BandEmissivity>& bands) {
  Json out = Json::object();
  for (const scene::BandEmissivity& band : bands) out.set(band.band, band.emissivity_frac);
  return out;
}

Json layers_json(const Material& material) {
  Json layers = Json::array();
  for (const scene::Layer& layer : material.layers) {
    layers.push(Json::object()
                    .set("thickness_m", layer.thickness_m)
                    .set("conductivity_w_m_k", layer.conductivity_w_m_k)
                    .set("density_kg_m3", layer.density_kg_m3)
                    .set("specific_heat_j_kg_k", layer.specific_heat_j_kg_k));
  }
  return layers;
}

Json entry_json(const MaterialEntry& entry) {
  const Material& m = entry.material;
  Json out = Json::object();
  out.set("name", m.name).set("family", m.family);
  out.set("solar_absorptance_frac", m.solar_absorptance_frac);
  out.set("emissivity_frac", m.emissivity_frac);
  out.set("band_emissivity_frac", bands_json(m.band_emissivity));
  if (!m.emissivity_spectrum.samples.empty()) {
    out.set("emissivity_spectrum", spectrum_json(m.emissivity_spectrum));
  }
  if (m.spread) {
    out.set("spread", Json::object()
                          .set("solar_absorptance_frac", m.spread->solar_absorptance_frac)
                          .set("emissivity_frac", m.spread->emissivity_frac)
                          .set("band_emissivity_frac", bands_json(m.spread->band_emissivity))
                          .set("conductivity_frac", m.spread->conductivity_frac)
                          .set("heat_capacity_frac", m.spread->heat_capacity_frac));
  }
  if (m.prescribed_k) out.set("prescribed_k", *m.prescribed_k);
  if (!m.layers.empty()) {
    out.set("layers", layers_json(m)).set("resistance_m2k_w", resistance_m2k_w(m));
    out.set("heat_capacity_j_m2_k", heat_capacity_j_m2_k(m));
    out.set("inertia_j_m2_k_s05", inertia(m));
    out.set("base", kBases.at(static_cast<std::size_t>(m.base)));
    out.set("dry_layers_valid", m.dry_layers_valid);
  }
  if (m.foster_fit) {
    out.set("foster_fit", Json::object()
                              .set("horizon_s", m.foster_fit->horizon_s)
                              .set("rms_k", m.foster_fit->rms_k)
                              .set("max_k", m.foster_fit->max_k));
  }
  out.set("source", m.source).set("uncertainty", m.uncertainty);
  if (!entry.day.empty()) {
    const Extremes extremes = extremes_of(entry);
    out.set("day_least_k", extremes.least_k).set("day_greatest_k", extremes.greatest_k);
  }
  if (!entry.errors.empty()) {
    Json errors = Json::array();
    for (const ClimateError& error : entry.errors) {
      errors.push(Json::object()
                      .set("climate", error.climate)
                      .set("rms_k", error.rms_k)
                      .set("max_k", error.max_k));
    }
    out.set("climates", std::move(errors));
  }
  return out;
}

Plot day_plot(std::span<const MaterialEntry> entries, const std::string& family,
              const std::string& climate) {
  Plot plot{.title = fmt::format("{}: level surface in sun, {}", family_name(family), climate),
            .x = {.label = "local mean solar time, h"},
            .y = {.label = "surface, C"},
            .series = {}};
  constexpr double kDayH = 24.0;
  for (const std::size_t i : members_of(entries, family)) {
    const MaterialEntry& entry = entries[i];
    const Material& material = entry.material;
    PlotSeries series{.label = material.name, .points = {}, .line = true, .markers = false};
    if (!material.dry_layers_valid || scene::is_snow_or_ice(material)) {
      series.dashed = true;
      plot.x.label = "local mean solar time, h; dashed: more than layers, a guide only";
    }
    // A point every 15 minutes is enough for the eye.
    constexpr std::size_t kEvery = 3;
    for (std::size_t k = 0; k < entry.day.size(); k += kEvery) {
      const reference::CoursePoint& point = entry.day[k];
      const double before_end_h = (entry.day.back().time_s - point.time_s) / kHourS;
      series.points.push_back({kDayH - before_end_h, point.reference_k - kZeroCelsiusK, {}});
    }
    if (material.prescribed_k) {
      const double given_c = *material.prescribed_k - kZeroCelsiusK;
      series.points = {{0.0, given_c, {}}, {kDayH, given_c, {}}};
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

Plot band_plot(std::span<const MaterialEntry> entries, const std::string& family) {
  Plot plot{.title = fmt::format("{}: emissivity by band", family_name(family)),
            .x = {.label = "band, um"},
            .y = {.label = "emissivity and its uncertainty"},
            .series = {}};
  plot.x.names.assign(kBands.begin(), kBands.end());
  const std::vector<std::size_t> members = members_of(entries, family);
  for (std::size_t place = 0; place < members.size(); ++place) {
    const Material& material = entries[members[place]].material;
    PlotSeries series{.label = material.name, .points = {}};
    // Bars of different materials stand beside each other.
    constexpr double kSpread = 0.7;
    const double shift =
        kSpread * ((static_cast<double>(place) + 0.5) / static_cast<double>(members.size()) - 0.5);
    for (std::size_t i = 0; i < kBands.size(); ++i) {
      if (not_covered(material, kBands[i])) continue;
      const double value = emissivity_of(material, kBands[i]);
      const double half = emissivity_spread(material, kBands[i]);
      series.points.push_back(
          {static_cast<double>(i + 1) + shift, value,
           fmt::format("{} {} um: {}", material.name, kBands[i], with_spread(value, half)),
           PlotRange{value - half, std::min(value + half, 1.0)}});
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

}  // namespace

std::vector<std::string> families_of(std::span<const MaterialEntry> entries) {
  std::vector<std::string> families;
  for (const MaterialEntry& entry : entries) {
    const std::string& family = entry.material.family;
    if (std::ranges::find(families, family) == families.end()) families.push_back(family);
  }
  return families;
}

void print_materials(std::FILE* out, std::span<const MaterialEntry> entries) {
  TextTable table({"material", "absorbs sun", "emits", "3-5 um", "8-12 um", "inertia",
                   "conductivity", "capacity", "fit RMS K", "max K"});
  for (const std::string& family : families_of(entries)) {
    table.add({family_name(family) + ":", "", "", "", "", "", "", "", "", ""});
    for (const std::size_t i : members_of(entries, family)) {
      const Material& m = entries[i].material;
      const scene::MaterialSpread spread = m.spread.value_or(scene::MaterialSpread{});
      const bool layers = !m.layers.empty();
      const bool fitted = m.foster_fit.has_value();
      table.add({"  " + m.name + (m.dry_layers_valid && !scene::is_snow_or_ice(m) ? "" : " *"),
                 with_spread(m.solar_absorptance_frac, spread.solar_absorptance_frac),
                 with_spread(m.emissivity_frac, spread.emissivity_frac), band_text(m, "3-5"),
                 band_text(m, "8-12"),
                 layers ? fmt::format("{:.0f}", inertia(m))
                        : fmt::format("{:.0f} K", m.prescribed_k.value_or(0.0)),
                 layers ? share_text(spread.conductivity_frac) : "-",
                 layers ? share_text(spread.heat_capacity_frac) : "-",
                 fitted ? fmt::format("{:.3f}", m.foster_fit->rms_k) : "-",
                 fitted ? fmt::format("{:.3f}", m.foster_fit->max_k) : "-"});
    }
  }
  fmt::print(out, "{}", table.to_string());
  fmt::print(out,
             "inertia: of the first layer, J m-2 K-1 s-1/2, or a given temperature; * is more than "
             "layers: melting, stirring or air that passes through matter\n"
             "{} materials; `emit materials NAME` shows layers, sources and a summer's day\n",
             entries.size());
  print_spectra(out, materials_of(entries));
}

void print_comparison(std::FILE* out, std::span<const MaterialEntry> entries) {
  constexpr std::size_t kBeside = 5;
  for (std::size_t begin = 0; begin < entries.size(); begin += kBeside) {
    const auto part = entries.subspan(begin, std::min(kBeside, entries.size() - begin));
    std::vector<std::string> header{""};
    for (const MaterialEntry& entry : part) header.push_back(entry.material.name);
    TextTable table(std::move(header));
    add_rows(table, part);
    fmt::print(out, "{}\n", table.to_string());
  }
  print_spectra(out, materials_of(entries));
  for (const MaterialEntry& entry : entries) {
    const Material& m = entry.material;
    fmt::print(out, "{}\n", m.name);
    for (const scene::Layer& layer : m.layers) {
      fmt::print(out, "  layer        {:g} m, {:g} W/m/K, {:g} kg/m3, {:g} J/kg/K\n",
                 layer.thickness_m, layer.conductivity_w_m_k, layer.density_kg_m3,
                 layer.specific_heat_j_kg_k);
    }
    if (m.prescribed_k) fmt::print(out, "  temperature  {:g} K\n", *m.prescribed_k);
    fmt::print(out, "  source       {}\n", m.source.empty() ? "not stated" : m.source);
    if (!m.uncertainty.empty()) fmt::print(out, "  uncertainty  {}\n", m.uncertainty);
  }
}

bool print_climates(std::FILE* out, std::span<const MaterialEntry> entries) {
  const auto checked = std::ranges::find_if(
      entries, [](const MaterialEntry& entry) { return !entry.errors.empty(); });
  if (checked == entries.end()) {
    fmt::print(out, "no material has layers to check\n");
    return true;
  }
  std::vector<std::string> header{"RMS / max K"};
  for (const ClimateError& error : checked->errors) header.push_back(error.climate);
  TextTable table(header);
  bool good = true;
  std::vector<const MaterialEntry*> worst_rms(checked->errors.size(), &*checked);
  std::vector<const MaterialEntry*> worst_max(checked->errors.size(), &*checked);
  for (const MaterialEntry& entry : entries) {
    if (entry.errors.empty()) continue;
    std::vector<std::string> cells{entry.material.name};
    for (std::size_t i = 0; i < entry.errors.size(); ++i) {
      const ClimateError& error = entry.errors[i];
      const bool below = error.rms_k < kClimateRmsBarK && error.max_k < kClimateMaxBarK;
      good = good && below;
      cells.push_back(
          fmt::format("{:.3f} / {:.3f}{}", error.rms_k, error.max_k, below ? "" : " !"));
      if (error.rms_k > worst_rms[i]->errors[i].rms_k) worst_rms[i] = &entry;
      if (error.max_k > worst_max[i]->errors[i].max_k) worst_max[i] = &entry;
    }
    table.add(std::move(cells));
  }
  fmt::print(out, "{}\n", table.to_string());
  for (std::size_t i = 0; i < checked->errors.size(); ++i) {
    fmt::print(out, "{}: RMS up to {:.3f} K ({}), error up to {:.3f} K ({})\n",
               checked->errors[i].climate, worst_rms[i]->errors[i].rms_k,
               worst_rms[i]->material.name, worst_max[i]->errors[i].max_k,
               worst_max[i]->material.name);
  }
  fmt::print(out,
             "worst of a day in sun and of five histories with shadows after it, model against the "
             "one-dimensional reference; both share forcing, film and layers; bars {:g} and {:g} "
             "K\n",
             kClimateRmsBarK, kClimateMaxBarK);
  return good;
}

Json materials_json(std::span<const MaterialEntry> entries) {
  Json materials = Json::array();
  for (const MaterialEntry& entry : entries) materials.push(entry_json(entry));
  return materials;
}

std::vector<Plot> material_plots(std::span<const MaterialEntry> entries,
                                 const std::string& climate) {
  std::vector<Plot> plots;
  for (const std::string& family : families_of(entries)) {
    plots.push_back(day_plot(entries, family, climate));
    plots.push_back(band_plot(entries, family));
    std::vector<Material> members;
    for (const std::size_t i : members_of(entries, family)) members.push_back(entries[i].material);
    Plot spectra = spectrum_plot(members, family_name(family));
    if (!spectra.series.empty()) plots.push_back(std::move(spectra));
  }
  return plots;
}

}  // namespace emit::tool
