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
  for (FosterMaterial& material : *made) material.water_slot = -1;
  number_water(*made);
  return made;
}

std::string shared_water_warning(const scene::ScenarioDesc& scenario,
                                 std::span<const scene::Material> materials,
                                 std::span<const FosterMaterial> built) {
  const bool gets_wet =
      std::ranges::any_of(scenario.weather,
                          [](const scene::WeatherSample& row) { return row.rain_mm_h > 0.0; }) ||
      std::ranges::any_of(
          built, [](const FosterMaterial& material) { return material.store.initial_mm > 0.0; });
  if (!gets_wet) return {};
  std::vector<std::string> names;
  for (std::size_t m = 0; m < materials.size(); ++m) {
    if (built[m].water_shared) {
      names.push_back(fmt::format("'{}' dries as another material does", materials[m].name));
    }
  }
  if (built.back().water_shared) names.push_back("the surroundings dry as another material does");
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const std::size_t twin = built[m].first_twin;
    if (twin != 0 && (built[twin].water_shared || built[twin + 1].water_shared)) {
      names.push_back(fmt::format("the clutter of '{}' dries as its mean does", materials[m].name));
    }
  }
  if (names.empty()) return {};
  return fmt::format("{}: more materials hold rain water than the {} whose drying is followed: {}",
                     scenario.file.string(), physics::kWaterSlots, fmt::join(names, ", "));
}

std::optional<FosterHistory> make_foster(const scene::ScenarioDesc& scenario,
                                         std::vector<FosterMaterial> materials,
                                         const Environment& environment, double reference_k,
                                         DryGrounds dry_grounds, StartNodes start_nodes) {
  if (materials.empty()) return std::nullopt;
  const FosterMaterial surroundings = materials.back();
  materials.pop_back();
  return FosterHistory(scenario, std::move(materials), surroundings, environment, reference_k,
                       dry_grounds, start_nodes);
}

}  // namespace emit::renderer
