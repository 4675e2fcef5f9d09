// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/sheets.hpp"

#include <algorithm>
#include <map>

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

std::vector<std::uint32_t> materials_of_sheets(const SceneGeometry& geometry) {
  std::vector<char> thin(geometry.materials.size());
  for (std::size_t m = 0; m < thin.size(); ++m) {
    thin[m] = sheet_of(geometry.materials[m]).has_value() ? 1 : 0;
  }
  std::vector<std::uint32_t> found;
  for (const Mesh& mesh : geometry.meshes) {
    const auto is_thin = [&](const Submesh& s) { return s.double_sided && thin[s.material] != 0; };
    if (std::ranges::none_of(mesh.submeshes, is_thin) || !may_have_sheets(mesh)) continue;
    for (const Submesh& submesh : mesh.submeshes) {
      if (is_thin(submesh)) found.push_back(submesh.material);
    }
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

void adopt_sheets(SceneGeometry& geometry) {
  // Append the material of a sheet for each material that has some.
  std::map<std::uint32_t, std::uint32_t> sheets;  // material -> its sheet
  for (const std::uint32_t m : materials_of_sheets(geometry)) {
    sheets.emplace(m, static_cast<std::uint32_t>(geometry.materials.size()));
    geometry.materials.push_back(*sheet_of(geometry.materials[m]));
  }
  for (Mesh& mesh : geometry.meshes) {
    const auto thin = [&](const Submesh& s) {
      return s.double_sided && sheets.contains(s.material);
    };
    if (std::ranges::none_of(mesh.submeshes, thin) || !may_have_sheets(mesh)) continue;
    for (Submesh& submesh : mesh.submeshes) {
      if (thin(submesh)) submesh.material = sheets.at(submesh.material);
    }
  }
}

}  // namespace emit::scene
