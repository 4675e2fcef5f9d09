// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/foster_history.hpp"

/// What the extended thermal model needs once, at set-up. Nothing of it costs emit2014 a byte but
/// an empty table.
namespace emit::renderer {

/// The networks of all simulated materials and, last, of the surroundings; empty for emit2014.
/// Errors (config) name the material.
[[nodiscard]] physics::Result<std::vector<FosterMaterial>> build_foster_materials(
    const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials);

/// Runs the spin-up; nothing for emit2014. `materials` as build_foster_materials() made them.
[[nodiscard]] std::optional<FosterHistory> make_foster(const scene::ScenarioDesc& scenario,
                                                       std::vector<FosterMaterial> materials,
                                                       const Environment& environment,
                                                       double reference_k);

}  // namespace emit::renderer
