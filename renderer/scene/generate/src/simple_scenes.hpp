// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/scenegen/generate.hpp"
#include "mesh_builder.hpp"

namespace emit::scenegen {

// Builders of the simple scenes. generate() has checked the options.
[[nodiscard]] Scene box_scene(const BoxOptions& options);
[[nodiscard]] Scene block_on_road_scene(const BlockOnRoadOptions& options);
[[nodiscard]] Scene ribbed_scene(const RibbedOptions& options);

}  // namespace emit::scenegen
