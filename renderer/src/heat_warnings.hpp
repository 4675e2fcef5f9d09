// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Adds warnings of what the thermal model and its method leave out of the heat of a scene: rain on
/// `bare` materials, and with `per-frame` roofs and the speed of entities. `rains` says that rain
/// is known. Setup only.
void add_heat_warnings(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
                       std::span<const std::uint32_t> bare, bool rains,
                       std::vector<std::string>& warnings);

}  // namespace emit::renderer
