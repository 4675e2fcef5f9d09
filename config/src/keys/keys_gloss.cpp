// SPDX-License-Identifier: Apache-2.0
#include "keys.hpp"

/// Keys of the gloss of materials.
namespace emit::config {

using scene::Gloss;
using scene::Material;

namespace {

/// Returns a key of a list of numbers.
template <class Field>
Key<Gloss> numbers_key(std::string name, std::string unit, Range range, Field field, double scale,
                       std::string meaning) {
  return custom<Gloss>(
      {name, "array of floats", std::move(unit), range.to_string(), std::move(meaning), false},
      [name, range, field, scale](Gloss& out, const Node& node, Diagnostics& diagnostics) {
        field(out).clear();
        if (node.kind != Node::Kind::array || node.items.empty()) {
          diagnostics.add(node.at, "'" + name + "' must be an array of numbers");
          return;
        }
        for (const Node& item : node.items) {
          double value = 0.0;
          read_number(item, name, range, value, diagnostics);
          field(out).push_back(value * scale);
        }
      },
      [field, scale](const Gloss& in) -> std::optional<std::string> {
        if (field(in).empty()) return std::nullopt;
        std::string out = "[";
        for (const double value : field(in)) {
          out += (out.size() > 1 ? ", " : "") + unscaled_number(value, scale);
        }
        return out + "]";
      });
}

}  // namespace

const KeyTable<Gloss>& gloss_keys() {
  static const KeyTable<Gloss> keys = {
      written_if([](const Gloss& in) { return in.index != physics::IndexTable::none; },
                 choice<Gloss>("index",
                               std::vector<std::pair<std::string, physics::IndexTable>>{
                                   {"water", physics::IndexTable::water},
                                   {"window_glass", physics::IndexTable::window_glass}},
                               EMIT_FIELD(index),
                               "Built-in optical constants: liquid water, or soda-lime glass.")),
      numbers_key("wavelength_um", "um", above_to(0, 1000), EMIT_FIELD(wavelength_um), 1.0,
                  "Wavelengths of your own optical constants, ascending. Between them they are "
                  "linear, outside the ends count."),
      numbers_key("refractive_index", "", above_to(0, 100), EMIT_FIELD(refractive_index), 1.0,
                  "Real part n of the index at each wavelength."),
      numbers_key("extinction_index", "", between(0, 100), EMIT_FIELD(extinction_index), 1.0,
                  "Imaginary part k of the index at each wavelength."),
      numbers_key("angle_deg", "deg", between(0, 89.9), EMIT_FIELD(angle_rad), physics::kDegree,
                  "Angles to the normal of a table by angle, from 0 on, ascending."),
      numbers_key("angle_emissivity_frac", "", between(0, 1), EMIT_FIELD(angle_emissivity_frac),
                  1.0,
                  "Emissivity of a smooth surface at each angle, in all bands. It falls to 0 at "
                  "90 degrees."),
      number<Gloss>("lobe_frac", "", between(0, 1), EMIT_FIELD(lobe_frac),
                    "Share of what the interface reflects that goes into the lobe. The rest is "
                    "diffuse."),
      written_if(
          [](const Gloss& in) { return !in.sea; },
          number<Gloss>("facet_slope", "", between(0.001, 1), EMIT_FIELD(facet_slope),
                        "Width of the slopes of the facets (GGX): 0.002 glass, 0.02 car paint, 0.3 "
                        "wet asphalt.")),
      boolean<Gloss>("sea", EMIT_FIELD(sea),
                     "`true`: the facets are wind waves with the slopes of Cox and Munk."),
      number<Gloss>("sea_wind_m_s", "m/s", between(0, 20), EMIT_FIELD(sea_wind_m_s),
                    "With `sea`: wind of the waves. Without it the wind of the weather at "
                    "simulation time 0 counts."),
  };
  return keys;
}

Key<Material> gloss_key() {
  return custom<Material>(
      {"gloss", "table", "", "",
       "Emission by angle and a lobe around the mirror direction. Without it the surface emits "
       "and reflects evenly. See `gloss` below.",
       false},
      [](Material& out, const Node& node, Diagnostics& diagnostics) {
        if (expect_table(node, "gloss", diagnostics)) {
          read_table(node, gloss_keys(), out.gloss.emplace(), diagnostics);
        }
      },
      [](const Material& in) -> std::optional<std::string> {
        if (!in.gloss) return std::nullopt;
        return inline_table(*in.gloss, gloss_keys());
      });
}

}  // namespace emit::config
