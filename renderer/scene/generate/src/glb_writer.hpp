// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>

#include "emit/physics/error.hpp"
#include "emit/scenegen/generate.hpp"
#include "mesh_builder.hpp"

namespace emit::scenegen {

/// Writes a scene as a glTF 2.0 binary file. The same scene gives the same bytes. Errors: io.
[[nodiscard]] physics::Result<GeneratedFile> write_glb(const std::filesystem::path& file,
                                                       const Scene& scene);

}  // namespace emit::scenegen
