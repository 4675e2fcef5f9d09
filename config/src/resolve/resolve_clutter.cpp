// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "resolve.hpp"

namespace emit::config {
namespace {

using scene::Clutter;
using scene::Material;

/// Reports a share of a material that the field would carry out of its range.
void check_share(const Node& node, std::string_view key, double middle_frac, double per_sd_frac,
                 Diagnostics& diagnostics) {
  const double most_frac = Clutter::kMostSd * std::abs(per_sd_frac);
  if (middle_frac - most_frac >= 0.0 && middle_frac + most_frac <= 1.0) return;
  diagnostics.add(key_location(node, node.has(key) ? key : "material"),
                  fmt::format("'{}' leads out of 0 to 1: the material has {}, and the field "
                              "reaches {} standard deviations",
                              key, toml_number(middle_frac), toml_number(Clutter::kMostSd)));
}

void check(const Node& node, const Clutter& clutter, const Material& material,
           const std::vector<std::string>& known_bands, Diagnostics& diagnostics) {
  if (!(clutter.longest_m > clutter.shortest_m) ||
      clutter.longest_m > Clutter::kMostRatio * clutter.shortest_m) {
    diagnostics.add(
        key_location(node, node.has("longest_m") ? "longest_m" : "shortest_m"),
        fmt::format("'longest_m' ({}) must be above 'shortest_m' ({}), and at most {} times it",
                    toml_number(clutter.longest_m), toml_number(clutter.shortest_m),
                    toml_number(Clutter::kMostRatio)));
  }
  check_share(node, "solar_absorptance_sd_frac", material.solar_absorptance_frac,
              clutter.solar_absorptance_sd_frac, diagnostics);
  check_share(node, "emissivity_sd_frac", material.emissivity_frac, clutter.emissivity_sd_frac,
              diagnostics);
  for (const scene::BandValue& entry : clutter.band_emissivity_sd_frac) {
    if (std::ranges::find(known_bands, entry.band) == known_bands.end()) {
      diagnostics.add(key_location(node, "band_emissivity_sd_frac"),
                      fmt::format("'band_emissivity_sd_frac': there is no band '{}'{}", entry.band,
                                  did_you_mean(entry.band, known_bands)));
    }
    // A band that the material does not list has its total emissivity, or that of a listed band
    // which it overlaps.
    if (std::ranges::find(material.band_emissivity, entry.band, &scene::BandEmissivity::band) ==
        material.band_emissivity.end()) {
      check_share(node, "band_emissivity_sd_frac", material.emissivity_frac, entry.value,
                  diagnostics);
    }
  }
  for (const scene::BandEmissivity& own : material.band_emissivity) {
    const auto listed =
        std::ranges::find(clutter.band_emissivity_sd_frac, own.band, &scene::BandValue::band);
    const bool given = listed != clutter.band_emissivity_sd_frac.end();
    check_share(node, given ? "band_emissivity_sd_frac" : "emissivity_sd_frac", own.emissivity_frac,
                given ? listed->value : clutter.emissivity_sd_frac, diagnostics);
  }
  const bool shows = std::ranges::any_of(clutter.band_emissivity_sd_frac,
                                         [](const auto& entry) { return entry.value != 0.0; });
  if (!clutter.changes_heat() && !shows) {
    diagnostics.add(node.at,
                    "[[clutter]] changes nothing: it has no '..._sd_frac' and no "
                    "'inertia_sd_ln'");
  }
  if (material.gloss && (clutter.emissivity_sd_frac != 0.0 || shows)) {
    diagnostics.add(node.at, fmt::format("material '{}' has 'gloss', which gives its emissivity: "
                                         "that cannot vary",
                                         material.name));
  }
  if (material.prescribed_k &&
      (clutter.solar_absorptance_sd_frac != 0.0 || clutter.inertia_sd_ln != 0.0)) {
    diagnostics.add(node.at, fmt::format("material '{}' has a prescribed temperature: only its "
                                         "emissivity can vary",
                                         material.name));
  }
}

}  // namespace

void resolve_clutter(const Node& root, const scene::ThermalOptions& thermal,
                     const std::vector<std::string>& known_bands, std::vector<Material>& materials,
                     Diagnostics& diagnostics) {
  std::vector<std::string> names;
  for (const Material& material : materials) names.push_back(material.name);
  for (const Node& node : section_array(root, "clutter", diagnostics)) {
    ClutterDraft draft;
    const std::size_t faults = diagnostics.size();
    read_table(node, clutter_keys(), draft, diagnostics);
    if (diagnostics.size() != faults) continue;
    if (thermal.method != scene::ThermalMethod::cached ||
        thermal.model != scene::ThermalModel::foster) {
      diagnostics.add(node.at,
                      "[[clutter]] needs thermal.method = \"cached\" and thermal.model = "
                      "\"foster\"");
      continue;
    }
    const auto material = std::ranges::find(materials, draft.material, &Material::name);
    if (material == materials.end()) {
      diagnostics.add(key_location(node, "material"),
                      fmt::format("there is no material '{}'{}", draft.material,
                                  did_you_mean(draft.material, names)));
      continue;
    }
    if (material->clutter) {
      diagnostics.add(key_location(node, "material"),
                      fmt::format("material '{}' has another [[clutter]] already", material->name));
      continue;
    }
    check(node, draft.clutter, *material, known_bands, diagnostics);
    material->clutter = std::move(draft.clutter);
  }
}

}  // namespace emit::config
