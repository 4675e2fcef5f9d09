// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::scene {

/// Returns the materials on which nobody knows what rain does, ascending: those of faces that look
/// up and hold no stated water (`water_store_mm`), but for open water and prescribed temperatures.
/// With emit2014, which has no rain, these are all materials of such faces. Setup only.
[[nodiscard]] std::vector<std::uint32_t> materials_without_rain(const ThermalOptions& thermal,
                                                                const SceneGeometry& geometry);

}  // namespace emit::scene
