// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/fit.hpp"
#include "emit/scene/scene_desc.hpp"

/// Materials that `emit fit` works on, and those that it writes.
namespace emit::tool {

/// Returns the library that modes go to and that a curve's material is looked up in: the shipped
/// one for an empty path. Errors: not_found.
[[nodiscard]] physics::Result<std::filesystem::path> fit_library(
    const std::filesystem::path& library);

/// Returns the named materials, or all that are simulated if no name is given. Errors:
/// invalid_argument, with the nearest name.
[[nodiscard]] physics::Result<std::vector<scene::Material>> fit_materials(
    std::span<const scene::Material> known, std::span<const std::string> names);

/// Checks that a library holds the very materials that were fitted, so that their modes may go
/// there. `input` is what the materials came from, for the message. Errors: those of
/// config::load_materials(); invalid_argument, naming the material.
[[nodiscard]] physics::Result<void> check_fit_library(const std::filesystem::path& library,
                                                      std::span<const scene::Material> materials,
                                                      const std::string& input);

/// Returns a material with the modes of a fit as a TOML table, to paste into a scenario or library.
[[nodiscard]] std::string fitted_material_toml(scene::Material material,
                                               const reference::FitResult& fit, bool foster);

}  // namespace emit::tool
