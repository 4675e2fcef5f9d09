// SPDX-License-Identifier: Apache-2.0
#include "tool/lab/fit_materials.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "emit/config/load.hpp"
#include "emit/physics/nearest_name.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Returns everything of a material that a fit can depend on, as text.
std::string fit_key(scene::Material material) {
  material.modes.clear();
  material.foster_modes.clear();
  material.foster_fit.reset();
  material.band_emissivity.clear();
  material.emissivity_spectrum = {};
  material.family.clear();
  material.source.clear();
  material.spread.reset();
  material.uncertainty.clear();
  return config::print_material(material);
}

}  // namespace

Result<std::filesystem::path> fit_library(const std::filesystem::path& library) {
  if (!library.empty()) return library;
  return config::find_data_file("materials/library.toml");
}

Result<std::vector<scene::Material>> fit_materials(std::span<const scene::Material> known,
                                                   std::span<const std::string> names) {
  std::vector<scene::Material> chosen;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(known, name, &scene::Material::name);
    if (found == known.end()) {
      std::vector<std::string> all;
      for (const scene::Material& material : known) all.push_back(material.name);
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("there is no material '{}'{}", name, physics::did_you_mean(name, all)));
    }
    chosen.push_back(*found);
  }
  if (!names.empty()) return chosen;
  for (const scene::Material& material : known) {
    if (!material.prescribed_k) chosen.push_back(material);
  }
  return chosen;
}

Result<void> check_fit_library(const std::filesystem::path& library,
                               std::span<const scene::Material> materials,
                               const std::string& input) {
  const auto theirs = config::load_materials(library);
  if (!theirs) return tl::unexpected(theirs.error());
  for (const scene::Material& material : materials) {
    const auto found = std::ranges::find(*theirs, material.name, &scene::Material::name);
    const bool known = found != theirs->end();
    if (known && fit_key(*found) == fit_key(material)) continue;
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("--out: material '{}' of {} {} {}; --toml writes it to paste", material.name,
                    input, known ? "is not the one of" : "is not in", library.string()));
  }
  return {};
}

std::string fitted_material_toml(scene::Material material, const reference::FitResult& fit,
                                 bool foster) {
  if (!foster) {
    material.modes = fit.modes;
    return config::print_material(material);
  }
  material.foster_modes.clear();
  for (std::size_t i = 0; i < fit.network.count; ++i) {
    const physics::NetworkMode& mode = fit.network.modes[i];
    material.foster_modes.push_back({mode.tau_s, mode.resistance_m2k_w});
  }
  material.foster_fit = scene::FosterFit{fit.horizon_s, fit.rms_k, fit.max_k};
  return config::print_material(material);
}

}  // namespace emit::tool
