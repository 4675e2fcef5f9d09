// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "mesh_builder.hpp"

namespace emit::scenegen {

/// Returns `sea`, a level square of water of 8 km, and `ship`, a patrol boat of 60 m whose water
/// line lies at height 0. Materials: sea; vehicle_grey, window, painted_metal, rubber.
[[nodiscard]] std::vector<std::pair<std::string, Scene>> sea_scenes();

}  // namespace emit::scenegen
