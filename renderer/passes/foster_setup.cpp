// SPDX-License-Identifier: Apache-2.0
#include "passes/foster_setup.hpp"

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

void add_resistances(const std::optional<FosterHistory>& foster,
                     std::span<gpu::MaterialParams> params) noexcept {
  if (!foster) return;
  for (std::size_t m = 0; m < params.size(); ++m) {
    const physics::FosterNetwork& network = foster->materials()[m].network;
    for (std::size_t i = 0; i < network.count; ++i) {
      params[m].resistance_m2k_w[static_cast<glm::length_t>(i)] =
          static_cast<float>(network.modes[i].resistance_m2k_w);
    }
  }
}

gl::Buffer make_spin_up_buffer(const std::optional<FosterHistory>& foster) {
  const glm::vec4 nothing(0.0F);
  const std::span<const glm::vec4> table =
      foster ? foster->table() : std::span<const glm::vec4>(&nothing, 1);
  return gl::Buffer(table.size_bytes(), table.data(), GL_DYNAMIC_STORAGE_BIT);
}

}  // namespace emit::renderer
