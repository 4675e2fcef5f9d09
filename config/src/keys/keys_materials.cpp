// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/foster.hpp"
#include "keys.hpp"

/// Keys of materials, in scenarios and in library files.
namespace emit::config {

using scene::BaseKind;
using scene::FosterFit;
using scene::FosterMode;
using scene::Layer;
using scene::Material;
using scene::MaterialSpread;
using scene::RelaxationMode;
using scene::Roughness;

const KeyTable<Layer>& layer_keys() {
  static const KeyTable<Layer> keys = {
      required(number<Layer>("thickness_m", "m", above_to(0, 100), EMIT_FIELD(thickness_m),
                             "Thickness.")),
      required(number<Layer>("conductivity_w_m_k", "W m-1 K-1", above_to(0, 1000),
                             EMIT_FIELD(conductivity_w_m_k), "Thermal conductivity.")),
      required(number<Layer>("density_kg_m3", "kg m-3", above_to(0, 25000),
                             EMIT_FIELD(density_kg_m3), "Density.")),
      required(number<Layer>("specific_heat_j_kg_k", "J kg-1 K-1", above_to(0, 20000),
                             EMIT_FIELD(specific_heat_j_kg_k), "Specific heat.")),
  };
  return keys;
}

const KeyTable<RelaxationMode>& mode_keys() {
  static const KeyTable<RelaxationMode> keys = {
      required(number<RelaxationMode>("tau_s", "s", above_to(0, 1e8), EMIT_FIELD(tau_s),
                                      "Time constant.")),
      required(number<RelaxationMode>("weight_frac", "", between(0, 1), EMIT_FIELD(weight_frac),
                                      "Share of the step response. All shares add up to 1.")),
  };
  return keys;
}

const KeyTable<FosterMode>& foster_mode_keys() {
  static const KeyTable<FosterMode> keys = {
      required(
          number<FosterMode>("tau_s", "s", above_to(0, 1e9), EMIT_FIELD(tau_s), "Time constant.")),
      required(number<FosterMode>("resistance_m2k_w", "m2 K W-1", above_to(0, 1e4),
                                  EMIT_FIELD(resistance_m2k_w),
                                  "Thermal resistance. All add up to that of the layers.")),
  };
  return keys;
}

const KeyTable<FosterFit>& foster_fit_keys() {
  static const KeyTable<FosterFit> keys = {
      required(number<FosterFit>("horizon_s", "s", above_to(0, 1e8), EMIT_FIELD(horizon_s),
                                 "Length of the histories that the modes were fitted over.")),
      required(number<FosterFit>("rms_k", "K", between(0, 1000), EMIT_FIELD(rms_k),
                                 "Root mean square of the residual in the worst history.")),
      required(number<FosterFit>("max_k", "K", between(0, 1000), EMIT_FIELD(max_k),
                                 "Largest residual of all histories.")),
  };
  return keys;
}

namespace {

// The keys of a material that hold tables, each with what is checked across its entries.

/// Returns the key `band_emissivity_frac` of a struct that has a number per band.
template <class T>
Key<T> band_emissivity_key(std::string meaning) {
  return band_numbers<T>("band_emissivity_frac", "", between(0, 1), EMIT_FIELD(band_emissivity),
                         &scene::BandEmissivity::emissivity_frac, std::move(meaning));
}

Key<Material> spread_key() {
  return custom<Material>(
      {"spread", "table", "", "",
       "Half-widths of the ranges in which the numbers lie, for lists and plots. See `spread` "
       "below.",
       false},
      [](Material& out, const Node& node, Diagnostics& diagnostics) {
        if (expect_table(node, "spread", diagnostics)) {
          read_table(node, spread_keys(), out.spread.emplace(), diagnostics);
        }
      },
      [](const Material& in) -> std::optional<std::string> {
        if (!in.spread) {
          return std::nullopt;
        }
        return inline_table(*in.spread, spread_keys());
      });
}

Key<Material> layers_key() {
  return custom<Material>(
      {"layers", "array of tables", "", "1 .. 16",
       "Layers from the outside down to `base`. emit2014 uses the "
       "first. Required without `prescribed_k`. See `layers` below.",
       false},
      [](Material& out, const Node& node, Diagnostics& diagnostics) {
        read_array(node, "layers", layer_keys(), Layer{}, out.layers, diagnostics);
        if (out.layers.size() > 16) {
          diagnostics.add(node.at, "'layers' has " + std::to_string(out.layers.size()) +
                                       " entries, at most 16 are taken");
        }
      },
      [](const Material& in) { return write_array(in.layers, layer_keys()); });
}

Key<Material> relaxation_modes_key() {
  return custom<Material>(
      {"modes", "array of tables", "", "1 .. 2, weights add up to 1",
       "emit2014: relaxation modes. Without them the slab formula (slab_modes.hpp) derives "
       "them from the first layer. See `modes` below.",
       false},
      [](Material& out, const Node& node, Diagnostics& diagnostics) {
        const std::size_t faults = diagnostics.size();
        read_array(node, "modes", mode_keys(), RelaxationMode{}, out.modes, diagnostics);
        if (diagnostics.size() != faults) {
          return;
        }
        if (out.modes.empty() || out.modes.size() > limits::kMaxRelaxationModes) {
          diagnostics.add(node.at, "'modes' has " + std::to_string(out.modes.size()) +
                                       " entries, must have 1 or 2");
          return;
        }
        double sum = 0.0;
        for (const RelaxationMode& mode : out.modes) {
          sum += mode.weight_frac;
        }
        if (std::abs(sum - 1.0) > 1e-6) {
          diagnostics.add(node.at,
                          "the weights of 'modes' add up to " + toml_number(sum) + ", must be 1");
        }
      },
      [](const Material& in) { return write_array(in.modes, mode_keys()); });
}

Key<Material> foster_modes_key() {
  return custom<Material>(
      {"foster_modes", "array of tables", "", "1 .. 6, resistances add up to that of the layers",
       "foster: modes, fastest first, as `emit fit` writes them. Without them they are derived "
       "from the layers. See `foster_modes` below.",
       false},
      [](Material& out, const Node& node, Diagnostics& diagnostics) {
        const std::size_t faults = diagnostics.size();
        read_array(node, "foster_modes", foster_mode_keys(), FosterMode{}, out.foster_modes,
                   diagnostics);
        if (diagnostics.size() != faults) {
          return;
        }
        if (out.foster_modes.empty() || out.foster_modes.size() > physics::kMaxFosterModes) {
          diagnostics.add(node.at, "'foster_modes' has " + std::to_string(out.foster_modes.size()) +
                                       " entries, must have 1 to 6");
          return;
        }
        for (std::size_t i = 1; i < out.foster_modes.size(); ++i) {
          if (out.foster_modes[i].tau_s <= out.foster_modes[i - 1].tau_s) {
            diagnostics.add(node.items[i].at, "time constants of 'foster_modes' must increase");
          }
        }
      },
      [](const Material& in) -> std::optional<std::string> {
        if (in.foster_modes.empty()) {
          return std::nullopt;
        }
        return write_array(in.foster_modes, foster_mode_keys());
      });
}

Key<Material> foster_fit_key() {
  return custom<Material>(
      {"foster_fit", "table", "", "",
       "Error of `foster_modes` against the reference solver as `emit fit` found it: "
       "`horizon_s`, `rms_k`, `max_k`.",
       false},
      [](Material& out, const Node& node, Diagnostics& diagnostics) {
        if (expect_table(node, "foster_fit", diagnostics)) {
          read_table(node, foster_fit_keys(), out.foster_fit.emplace(), diagnostics);
        }
      },
      [](const Material& in) -> std::optional<std::string> {
        if (!in.foster_fit) {
          return std::nullopt;
        }
        return inline_table(*in.foster_fit, foster_fit_keys());
      });
}

Key<Material> base_k_key() {
  Key<Material> key = number<Material>(
      "base_k", "K", between(150, 2000), EMIT_FIELD(base_k),
      "Temperature under the last layer. It wins over what `base` gives. Without `base` it is "
      "required, unless there is `prescribed_k`.");
  key.read = [inner = std::move(key.read)](Material& out, const Node& node,
                                           Diagnostics& diagnostics) {
    inner(out, node, diagnostics);
    out.base_stated = true;
  };
  return written_if([](const Material& in) { return in.base_stated; }, std::move(key));
}

/// Key of the file of a spectrum. It is not written, because the samples are.
Key<Material> emissivity_spectrum_file_key() {
  return written_if(
      [](const Material&) { return false; },
      path<Material>("emissivity_spectrum_file", EMIT_FIELD(emissivity_spectrum.file),
                     "CSV file `wavelength_um,emissivity_frac` or `wavelength_um,reflectance_frac` "
                     "in place of `emissivity_spectrum`."));
}

}  // namespace

const KeyTable<MaterialSpread>& spread_keys() {
  static const KeyTable<MaterialSpread> keys = {
      number<MaterialSpread>("solar_absorptance_frac", "", between(0, 1),
                             EMIT_FIELD(solar_absorptance_frac),
                             "Added to and taken from `solar_absorptance_frac`."),
      number<MaterialSpread>(
          "emissivity_frac", "", between(0, 1), EMIT_FIELD(emissivity_frac),
          "Added to and taken from `emissivity_frac`, and from bands that are not listed."),
      band_emissivity_key<MaterialSpread>("The same by name of the band."),
      number<MaterialSpread>("conductivity_frac", "", between(0, 1), EMIT_FIELD(conductivity_frac),
                             "Share of the conductivity of every layer: 0.2 is +-20 %."),
      number<MaterialSpread>("heat_capacity_frac", "", between(0, 1),
                             EMIT_FIELD(heat_capacity_frac),
                             "Share of the heat capacity of every layer."),
  };
  return keys;
}

const KeyTable<Material>& material_keys() {
  static const KeyTable<Material> keys = {
      required(text<Material>("name", EMIT_FIELD(name), "Unique name of the material.")),
      required(number<Material>("solar_absorptance_frac", "", between(0, 1),
                                EMIT_FIELD(solar_absorptance_frac),
                                "Share of sunlight that is absorbed: 1 - albedo.")),
      open_default(number<Material>(
          "emissivity_frac", "", between(0.01, 1), EMIT_FIELD(emissivity_frac),
          "Total hemispherical emissivity in the long-wave infrared. Required without a spectrum "
          "that covers 60 % of what a blackbody emits.")),
      band_emissivity_key<Material>(
          "Emissivities by name of the band. Other bands take that of the spectrum, else of the "
          "listed "
          "built-in band that they overlap most, else `emissivity_frac`."),
      curve<Material>("emissivity_spectrum", EMIT_FIELD(emissivity_spectrum.samples),
                      "Emissivity over wavelength, linear between its points. See Spectra."),
      emissivity_spectrum_file_key(),
      layers_key(),
      choice<Material>("roughness",
                       std::vector<std::pair<std::string, Roughness>>{
                           {"very_rough", Roughness::very_rough},
                           {"rough", Roughness::rough},
                           {"medium_rough", Roughness::medium_rough},
                           {"medium_smooth", Roughness::medium_smooth},
                           {"smooth", Roughness::smooth},
                           {"very_smooth", Roughness::very_smooth},
                           {"open_water", Roughness::open_water}},
                       EMIT_FIELD(roughness),
                       "foster: roughness for the wind: gravel and crops are very_rough, brick "
                       "rough, concrete medium_rough, fabric medium_smooth, painted metal smooth, "
                       "glass very_smooth, water open_water."),
      number<Material>("leaf_width_m", "m", above_to(0.0, 1.0), EMIT_FIELD(leaf_width_m),
                       "foster: width of leaves, needles or strips. Their film takes the place of "
                       "that of `roughness`. Without it the surface is closed."),
      number<Material>("leaf_area_index", "", between(0.1, 10), EMIT_FIELD(leaf_area_index),
                       "foster: area of these leaves, one side, by that of the surface: 2 of a "
                       "crown, 1 of a net. Without it 2 counts."),
      written_if([](const Material& in) { return !in.layers.empty(); },
                 choice<Material>(
                     "base",
                     std::vector<std::pair<std::string, BaseKind>>{{"ground", BaseKind::ground},
                                                                   {"air", BaseKind::air},
                                                                   {"room", BaseKind::room},
                                                                   {"body", BaseKind::body}},
                     EMIT_FIELD(base),
                     "What the last layer rests on: ground at that depth, outdoor air, a room of "
                     "`base_k`, "
                     "or the interior of a vehicle. See Bases.")),
      base_k_key(),
      number<Material>("core_conductance_w_m2_k", "W m-2 K-1", above_to(0, 1e7),
                       EMIT_FIELD(core_conductance_w_m2_k),
                       "emit2014: conductance between surface and core, for sheets. Without it "
                       "that of the first layer counts. It goes with `modes`."),
      number<Material>("initial_k", "K", between(150, 2000), EMIT_FIELD(initial_k),
                       "Surface temperature at the start. Without it `thermal.initial_k` counts."),
      relaxation_modes_key(),
      foster_modes_key(),
      foster_fit_key(),
      number<Material>(
          "wetness_frac", "", between(0, 1), EMIT_FIELD(wetness_frac),
          "foster: share of the evaporation of a surface that is moist all over: 1 open "
          "water, 0 dry. See Evaporation."),
      number<Material>("surface_resistance_s_m", "s m-1", between(0, 1e4),
                       EMIT_FIELD(surface_resistance_s_m),
                       "foster: resistance between the water and the air at the surface, in "
                       "sunlight: 70 for well-watered short grass, 0 for open water."),
      number<Material>("night_resistance_s_m", "s m-1", between(0, 1e5),
                       EMIT_FIELD(night_resistance_s_m),
                       "foster: the same without sunlight, when stomata are closed. Without it "
                       "that in sunlight counts."),
      gloss_key(),
      number<Material>(
          "water_store_mm", "mm", above_to(0, 200), EMIT_FIELD(water_store_mm),
          "foster: rain that the surface holds, 0.5 on asphalt, 2 on grass. Without it "
          "rain leaves the surface as it is. See Evaporation."),
      number<Material>("readily_evaporable_mm", "mm", above_to(0, 100),
                       EMIT_FIELD(readily_evaporable_mm),
                       "foster: part of the store that evaporates as freely as open water, 2 of "
                       "sand, 10 of clay. It makes the store that of soil."),
      boolean<Material>("dry_layers_valid", EMIT_FIELD(dry_layers_valid),
                        "`false` says that heat also moves by melting, stirring or other "
                        "evaporation. Temperatures are a guide only, and frames say so."),
      number<Material>(
          "prescribed_k", "K", between(100, 5000), EMIT_FIELD(prescribed_k),
          "Given temperature of a part, such as a hot engine. It has no thermal simulation."),
      text<Material>("family", EMIT_FIELD(family),
                     "Kind of material, by which `emit materials` groups. Dry materials of `water, "
                     "snow and ice` count as snow or ice (`melting` of frames)."),
      text<Material>("source", EMIT_FIELD(source), "Source of the numbers."),
      spread_key(),
      text<Material>("uncertainty", EMIT_FIELD(uncertainty),
                     "What else limits the numbers, beyond `spread`."),
  };
  return keys;
}

}  // namespace emit::config
