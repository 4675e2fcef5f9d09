// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/physics/error.hpp"
#include "emit/scenegen/generate.hpp"
#include "mesh_builder.hpp"

namespace emit::scenegen {

/// Builds the statue scene. generate() has checked the options. Errors (internal): the number of
/// triangles cannot be reached.
[[nodiscard]] physics::Result<Scene> statue_scene(const StatueOptions& options);

}  // namespace emit::scenegen
