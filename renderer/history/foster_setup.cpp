// SPDX-License-Identifier: Apache-2.0
#include "history/foster_setup.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace emit::renderer {

physics::Result<std::vector<FosterMaterial>> build_foster_materials(
    const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials) {
  if (scenario.thermal.model != scene::ThermalModel::foster) return std::vector<FosterMaterial>{};
  const std::string& name = scenario.thermal.surroundings_material.empty()
                                ? scenario.default_material
                                : scenario.thermal.surroundings_material;
  std::vector<scene::Material> all(materials.begin(), materials.end());
  const auto surroundings =
      std::find_if(scenario.materials.begin(), scenario.materials.end(),
                   [&](const scene::Material& material) { return material.name == name; });
  if (surroundings == scenario.materials.end()) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("there is no material '{}' for the surroundings", name));
  }
  all.push_back(*surroundings);
  return foster_materials(all, scenario.thermal);
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
