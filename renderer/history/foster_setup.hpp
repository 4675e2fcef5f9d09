// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/foster_history.hpp"

/// Set-up of the extended thermal model, done once. With the model emit2014 it costs nothing but an
/// empty table.
/// Thread: any.  Real time: setup only.
namespace emit::renderer {

/// Magnitude of the clutter's field at which twins of a material are solved, in standard
/// deviations.
inline constexpr double kTwinSd = 1.5;

/// Returns a material with clutter as it is where the field has the value `sd` (physics.md eq. 56).
/// Its thermal inertia changes at the same diffusivity: conductivities and heat capacities of all
/// layers by one factor.
/// @pre material.clutter
[[nodiscard]] scene::Material material_at(const scene::Material& material, double sd);

/// Returns the networks of all simulated materials, then of the twins of those with clutter that
/// changes temperatures and, as the last entry, of the surroundings. The vector is empty for
/// emit2014.
/// Errors (config) name the material.
[[nodiscard]] physics::Result<std::vector<FosterMaterial>> build_foster_materials(
    const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials);

/// Returns a warning that names the materials that dry as others do because there are too few slots
/// for water; empty if there are none, or if nothing is known to get wet. `built` is the result of
/// build_foster_materials() for the same `materials`, and not empty.
[[nodiscard]] std::string shared_water_warning(const scene::ScenarioDesc& scenario,
                                               std::span<const scene::Material> materials,
                                               std::span<const FosterMaterial> built);

/// Runs the spin-up with the `materials` of build_foster_materials(). Returns nothing for emit2014.
[[nodiscard]] std::optional<FosterHistory> make_foster(
    const scene::ScenarioDesc& scenario, std::vector<FosterMaterial> materials,
    const Environment& environment, double reference_k,
    DryGrounds dry_grounds = DryGrounds::followed, StartNodes start_nodes = StartNodes::all);

}  // namespace emit::renderer
