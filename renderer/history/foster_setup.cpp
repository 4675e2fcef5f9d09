// SPDX-License-Identifier: Apache-2.0
#include "history/foster_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace emit::renderer {
scene::Material material_at(const scene::Material& material, double sd) {
  const scene::Clutter& clutter = *material.clutter;
  scene::Material out = material;
  const auto share = [sd](double middle_frac, double per_sd_frac) {
    return std::clamp(middle_frac + sd * per_sd_frac, 0.0, 1.0);
  };
  out.solar_absorptance_frac =
      share(material.solar_absorptance_frac, clutter.solar_absorptance_sd_frac);
  out.emissivity_frac = share(material.emissivity_frac, clutter.emissivity_sd_frac);
  for (scene::BandEmissivity& entry : out.band_emissivity) {
    entry.emissivity_frac = share(entry.emissivity_frac, emissivity_sd_frac(clutter, entry.band));
  }
  const double factor = std::exp(sd * clutter.inertia_sd_ln);
  for (scene::Layer& layer : out.layers) {
    layer.conductivity_w_m_k *= factor;
    layer.specific_heat_j_kg_k *= factor;
  }
  // Time constants depend on the diffusivity, which stays.
  for (scene::FosterMode& mode : out.foster_modes) mode.resistance_m2k_w /= factor;
  out.clutter.reset();
  return out;
}

physics::Result<std::vector<FosterMaterial>> build_foster_materials(
    const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials) {
  if (scenario.thermal.model != scene::ThermalModel::foster) return std::vector<FosterMaterial>{};
  const std::string& name = scenario.thermal.surroundings_material.empty()
                                ? scenario.default_material
                                : scenario.thermal.surroundings_material;
  std::vector<scene::Material> all(materials.begin(), materials.end());
  std::vector<std::uint32_t> first_twins(materials.size(), 0);
  for (std::size_t m = 0; m < materials.size(); ++m) {
    if (!scene::varies_in_heat(materials[m])) continue;
    first_twins[m] = static_cast<std::uint32_t>(all.size());
    for (const double sd : {-kTwinSd, kTwinSd}) all.push_back(material_at(materials[m], sd));
  }
  const auto surroundings =
      std::find_if(scenario.materials.begin(), scenario.materials.end(),
                   [&](const scene::Material& material) { return material.name == name; });
  if (surroundings == scenario.materials.end()) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("there is no material '{}' for the surroundings", name));
  }
  all.push_back(*surroundings);
  auto made = foster_materials(all, scenario.thermal);
  if (!made) return made;
  for (std::size_t m = 0; m < materials.size(); ++m) (*made)[m].first_twin = first_twins[m];
  return made;
}

std::optional<FosterHistory> make_foster(const scene::ScenarioDesc& scenario,
                                         std::vector<FosterMaterial> materials,
                                         const Environment& environment, double reference_k) {
  if (materials.empty()) return std::nullopt;
  const FosterMaterial surroundings = materials.back();
  materials.pop_back();
  return FosterHistory(scenario, std::move(materials), surroundings, environment, reference_k);
}

}  // namespace emit::renderer
