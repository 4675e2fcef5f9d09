// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/sheets.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>

namespace emit::scene {
namespace {

/// Convection and radiation of a face of 290 K. The library's modes are derived with the same
/// value.
constexpr double kFilmW_m2_k = 19.0;

}  // namespace

std::optional<Material> sheet_of(const Material& material) {
  if (material.prescribed_k) return std::nullopt;
  Material sheet = material;
  // The only film in emit2014 is the one to the core behind the layers.
  if (!sheet.core_conductance_w_m2_k) {
    double gas_m2k_w = 0.0;
    for (const Layer& layer : material.layers) {
      if (layer.density_kg_m3 < kMaxGasKgM3)
        gas_m2k_w += layer.thickness_m / layer.conductivity_w_m_k;
    }
    sheet.core_conductance_w_m2_k = gas_m2k_w > 0.0 ? 1.0 / gas_m2k_w : 0.0;
  }
  const auto gas = std::ranges::find_if(
      sheet.layers, [](const Layer& l) { return l.density_kg_m3 < kMaxGasKgM3; });
  sheet.layers.erase(gas, sheet.layers.end());
  if (sheet.layers.empty()) return std::nullopt;
  double resistance_m2k_w = 0.0;
  double capacity_j_m2_k = 0.0;
  for (Layer& layer : sheet.layers) {
    resistance_m2k_w += layer.thickness_m / layer.conductivity_w_m_k;
    layer.thickness_m *= 0.5;
    capacity_j_m2_k += layer.thickness_m * layer.density_kg_m3 * layer.specific_heat_j_kg_k;
  }
  if (resistance_m2k_w > kMaxSheetResistanceM2kW) return std::nullopt;
  sheet.sheet = true;
  sheet.name = sheet_name(sheet.name);
  sheet.modes = {{capacity_j_m2_k / kFilmW_m2_k, 1.0}};
  sheet.foster_modes.clear();
  sheet.foster_fit.reset();
  return sheet;
}

bool may_have_sheets(const Mesh& mesh) {
  if (std::ranges::none_of(mesh.submeshes, &Submesh::double_sided)) return false;
  Mesh without_flags = mesh;
  for (Submesh& submesh : without_flags.submeshes) submesh.double_sided = false;
  return !is_closed_surface(without_flags);
}

void adopt_sheets(SceneGeometry& geometry) {
  std::map<std::uint32_t, std::uint32_t> sheets;  // material -> its sheet
  const std::size_t materials = geometry.materials.size();
  for (std::uint32_t m = 0; m < materials; ++m) {
    if (auto sheet = sheet_of(geometry.materials[m])) {
      sheets.emplace(m, static_cast<std::uint32_t>(materials + sheets.size()));
      geometry.materials.push_back(std::move(*sheet));
    }
  }
  std::vector<char> used(geometry.materials.size(), 0);
  for (Mesh& mesh : geometry.meshes) {
    const auto thin = [&](const Submesh& s) {
      return s.double_sided && s.material < materials && sheets.contains(s.material);
    };
    if (std::ranges::none_of(mesh.submeshes, thin) || !may_have_sheets(mesh)) continue;
    for (Submesh& submesh : mesh.submeshes) {
      if (thin(submesh)) submesh.material = sheets.at(submesh.material);
      used[submesh.material] = 1;
    }
  }
  // Keep only the sheets that are in use.
  std::vector<std::uint32_t> renumbered(geometry.materials.size());
  std::uint32_t next = 0;
  for (std::uint32_t m = 0; m < geometry.materials.size(); ++m) {
    renumbered[m] = next;
    if (m >= materials && used[m] == 0) continue;
    if (next != m) geometry.materials[next] = std::move(geometry.materials[m]);
    ++next;
  }
  geometry.materials.resize(next);
  for (Mesh& mesh : geometry.meshes) {
    for (Submesh& submesh : mesh.submeshes) submesh.material = renumbered[submesh.material];
  }
}

}  // namespace emit::scene
