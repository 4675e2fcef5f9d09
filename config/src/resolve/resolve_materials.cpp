// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "check_curve.hpp"
#include "emit/config/slab_modes.hpp"
#include "emit/scene/gloss_optics.hpp"
#include "resolve.hpp"

namespace emit::config {

using scene::Material;

namespace {

std::string node_name(const Node& material) {
  const Node* name = material.find("name");
  return name != nullptr && name->kind == Node::Kind::text ? name->text : std::string();
}

void append_library(const std::filesystem::path& file, std::vector<Node>& nodes,
                    Diagnostics& diagnostics, const Location& named_at) {
  physics::Result<Node> library = parse_toml_file(file);
  if (!library) {
    if (library.error().code == physics::ErrorCode::config) {
      diagnostics.add(named_at, fmt::format("material library: {}", library.error().text));
    } else {
      diagnostics.add(named_at, fmt::format("'materials': {}", library.error().text));
    }
    return;
  }
  for (Member& member : library->members) {
    if (member.key != "material") {
      diagnostics.add(member.key_at, unknown_key_text(member.key, {"material"}));
    } else if (expect_table_array(member.value, "material", diagnostics)) {
      for (Node& item : member.value.items) {
        nodes.push_back(std::move(item));
      }
    }
  }
}

/// Reports names in the table `band_emissivity_frac` of a node that no band has.
void check_bands(const Node& node, const std::vector<std::string>& known_bands,
                 Diagnostics& diagnostics) {
  const Node* bands = node.find("band_emissivity_frac");
  if (bands == nullptr || bands->kind != Node::Kind::table) return;
  for (const Member& member : bands->members) {
    if (std::find(known_bands.begin(), known_bands.end(), member.key) == known_bands.end()) {
      diagnostics.add(member.key_at, fmt::format("there is no band '{}'{}", member.key,
                                                 did_you_mean(member.key, known_bands)));
    }
  }
}

/// Reports keys of evaporation that can have no effect, or that contradict each other.
void check_moisture(const Material& material, const Node& node, Diagnostics& diagnostics) {
  if (material.prescribed_k) {
    for (const char* key : {"wetness_frac", "surface_resistance_s_m", "night_resistance_s_m",
                            "water_store_mm", "readily_evaporable_mm"}) {
      if (!node.has(key)) continue;
      diagnostics.add(key_location(node, key),
                      fmt::format("'{}' has no effect: 'prescribed_k' gives the temperature", key));
    }
    return;
  }
  if (material.readily_evaporable_mm) {
    const auto fault = [&](const char* key, const std::string& text) {
      diagnostics.add(key_location(node, key), text);
    };
    if (!material.water_store_mm) {
      fault("readily_evaporable_mm", "'readily_evaporable_mm' needs 'water_store_mm'");
    } else if (*material.readily_evaporable_mm >= *material.water_store_mm) {
      fault("readily_evaporable_mm",
            fmt::format("'readily_evaporable_mm' ({}) must be below 'water_store_mm' ({})",
                        toml_number(*material.readily_evaporable_mm),
                        toml_number(*material.water_store_mm)));
    } else if (material.surface_resistance_s_m) {
      fault("surface_resistance_s_m",
            "'surface_resistance_s_m' has no effect: 'readily_evaporable_mm' makes the store that "
            "of bare soil");
    }
  }
  if (!material.night_resistance_s_m) return;
  if (!material.surface_resistance_s_m) {
    diagnostics.add(key_location(node, "night_resistance_s_m"),
                    "'night_resistance_s_m' needs 'surface_resistance_s_m'");
  } else if (!(*material.surface_resistance_s_m > 0.0)) {
    diagnostics.add(key_location(node, "night_resistance_s_m"),
                    "'night_resistance_s_m' has no effect: 'surface_resistance_s_m' is 0");
  } else if (*material.night_resistance_s_m < *material.surface_resistance_s_m) {
    diagnostics.add(key_location(node, "night_resistance_s_m"),
                    fmt::format("'night_resistance_s_m' ({}) is below 'surface_resistance_s_m' "
                                "({}): stomata close at night",
                                toml_number(*material.night_resistance_s_m),
                                toml_number(*material.surface_resistance_s_m)));
  }
}

/// Reports a gloss without one source of its reflectance, and keys that have no effect.
void check_gloss(const Material& material, const Node& node, Diagnostics& diagnostics) {
  if (!material.gloss) return;
  const Node& gloss = *node.find("gloss");
  if (auto valid = scene::validate(*material.gloss); !valid) {
    diagnostics.add(gloss.at, valid.error().text);
    return;
  }
  if (material.gloss->sea && gloss.has("facet_slope")) {
    diagnostics.add(key_location(gloss, "facet_slope"),
                    "'facet_slope' has no effect: with 'sea' the wind gives the slopes");
  }
  if (!material.gloss->sea && gloss.has("sea_wind_m_s")) {
    diagnostics.add(key_location(gloss, "sea_wind_m_s"), "'sea_wind_m_s' needs 'sea'");
  }
}

void check_material(const Material& material, const Node& node,
                    const std::vector<std::string>& known_bands, Diagnostics& diagnostics) {
  if (node.has("name") && material.name.empty()) {
    diagnostics.add(key_location(node, "name"), "'name' is empty");
  }
  if (!node.has("emissivity_frac") && !node.has("emissivity_spectrum") &&
      !node.has("emissivity_spectrum_file")) {
    diagnostics.add(node.at, "key 'emissivity_frac' is missing");
  }
  if (!material.prescribed_k) {
    if (!node.has("layers")) {
      diagnostics.add(node.at, fmt::format("key 'layers' is missing (material '{}' has no "
                                           "prescribed_k)",
                                           material.name));
    }
    if (!node.has("base") && !node.has("base_k")) {
      diagnostics.add(node.at,
                      fmt::format("key 'base' is missing (material '{}' has neither base_k "
                                  "nor prescribed_k)",
                                  material.name));
    } else if (const Node* base = node.find("base");
               base != nullptr && base->text == "room" && !node.has("base_k")) {
      diagnostics.add(key_location(node, "base"),
                      "'base' is room: key 'base_k' is missing, which states its temperature");
    }
    if (const Node* layers = node.find("layers");
        layers != nullptr && layers->kind == Node::Kind::array && layers->items.empty()) {
      diagnostics.add(layers->at, "'layers' needs at least one layer");
    }
  }
  if (!material.foster_modes.empty() && !material.layers.empty()) {
    double of_modes = 0.0;
    double of_layers = 0.0;
    for (const scene::FosterMode& mode : material.foster_modes) of_modes += mode.resistance_m2k_w;
    for (const scene::Layer& layer : material.layers) {
      of_layers += layer.thickness_m / layer.conductivity_w_m_k;
    }
    if (std::abs(of_modes - of_layers) > 1e-3 * of_layers) {
      diagnostics.add(key_location(node, "foster_modes"),
                      fmt::format("the resistances of 'foster_modes' add up to {:.6g}, those of "
                                  "'layers' to {:.6g}: fit again",
                                  of_modes, of_layers));
    }
  }
  check_moisture(material, node, diagnostics);
  check_gloss(material, node, diagnostics);
  check_bands(node, known_bands, diagnostics);
  if (const Node* spread = node.find("spread")) check_bands(*spread, known_bands, diagnostics);
}

}  // namespace

std::vector<Node> collect_material_nodes(const Node& root,
                                         const std::vector<std::filesystem::path>& libraries,
                                         Diagnostics& diagnostics) {
  std::vector<Node> nodes;
  for (const std::filesystem::path& library : libraries) {
    append_library(library, nodes, diagnostics, key_location(root, "materials"));
  }
  // Two libraries with one name are a fault. The scenario's own material replaces a library's.
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const std::string name = node_name(nodes[i]);
    for (std::size_t j = 0; j < i && !name.empty(); ++j) {
      if (node_name(nodes[j]) == name) {
        diagnostics.add(nodes[i].at, fmt::format("material '{}' is already defined at {}", name,
                                                 nodes[j].at.to_string()));
        break;
      }
    }
  }
  std::vector<Node> own = section_array(root, "material", diagnostics);
  for (std::size_t i = 0; i < own.size(); ++i) {
    const std::string name = node_name(own[i]);
    for (std::size_t j = 0; j < i && !name.empty(); ++j) {
      if (node_name(own[j]) == name) {
        diagnostics.add(
            key_location(own[i], "name"),
            fmt::format("material '{}' is already defined at {}", name, own[j].at.to_string()));
        break;
      }
    }
  }
  for (Node& node : own) {
    const std::string name = node_name(node);
    const auto same = std::find_if(nodes.begin(), nodes.end(), [&name](const Node& other) {
      return !name.empty() && node_name(other) == name;
    });
    if (same != nodes.end()) {
      *same = std::move(node);
    } else {
      nodes.push_back(std::move(node));
    }
  }
  return nodes;
}

namespace {

/// Reads the spectrum of a material and checks it.
void resolve_spectrum(Material& material, const Node& node, Diagnostics& diagnostics) {
  constexpr std::string_view kInline = "emissivity_spectrum";
  constexpr std::string_view kFile = "emissivity_spectrum_file";
  scene::EmissivitySpectrum& spectrum = material.emissivity_spectrum;
  if (node.has(kInline) && node.has(kFile)) {
    diagnostics.add(key_location(node, kFile),
                    fmt::format("use only one of '{}' and '{}'", kInline, kFile));
    return;
  }
  if (!spectrum.file.empty()) {
    auto loaded = load_emissivity_csv(spectrum.file);
    if (!loaded) {
      report_file_error(loaded.error(), node, kFile, diagnostics);
      return;
    }
    spectrum.samples = std::move(*loaded);
  }
  const std::string_view key = node.has(kInline) ? kInline : kFile;
  if (node.has(key)) {
    // The stand-in keeps checks before fold_spectra() from finding faults in a missing number.
    if (!node.has("emissivity_frac")) material.emissivity_frac = 0.5;
    check_curve(spectrum.samples, fmt::format("'{}'", key), "emissivity", key_location(node, key),
                diagnostics);
  }
}

}  // namespace

std::vector<Material> resolve_materials(const std::vector<Node>& nodes,
                                        const std::vector<std::string>& known_bands,
                                        Diagnostics& diagnostics) {
  std::vector<Material> materials;
  for (const Node& node : nodes) {
    Material material;
    const std::size_t faults = diagnostics.size();
    read_table(node, material_keys(), material, diagnostics);
    if (diagnostics.size() == faults) resolve_spectrum(material, node, diagnostics);
    check_material(material, node, known_bands, diagnostics);
    if (diagnostics.size() == faults && material.modes.empty() && !material.layers.empty()) {
      material.modes = slab_modes(material.layers.front(), kSlabModesFilmWPerM2K,
                                  static_cast<int>(limits::kMaxRelaxationModes));
    }
    materials.push_back(std::move(material));
  }
  return materials;
}

void check_glosses(const std::vector<Node>& nodes, const scene::ScenarioDesc& scenario,
                   const std::vector<scene::SpectralBand>& declared,
                   const std::vector<Material>& materials, Diagnostics& diagnostics) {
  std::vector<scene::SpectralBand> bands = built_in_bands();
  bands.insert(bands.end(), declared.begin(), declared.end());
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const Material& material = materials[i];
    if (!material.gloss || !scene::validate(*material.gloss)) continue;
    const physics::Facets facets = scene::facets_of(material, scenario);
    if (auto fits = scene::check_emissivities(material, facets, bands); !fits) {
      diagnostics.add(nodes[i].find("gloss")->at, fits.error().text);
    }
  }
}

}  // namespace emit::config
