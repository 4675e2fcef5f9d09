// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scenegen/generate.hpp"

namespace emit::tool {

/// Returns the scene names that `generate` knows, in the order of `all`.
[[nodiscard]] std::vector<scenegen::SceneKind> all_scene_kinds();

/// Returns the names that generate_scenes() takes, "all" as the last.
[[nodiscard]] std::vector<std::string> scene_names();

/// Applies KEY=VALUE, e.g. "block_east_m=2", to the options of `options.kind`.
/// Errors: invalid_argument, naming the key, the nearest one and the keys that the scene has.
[[nodiscard]] physics::Result<void> apply_scene_options(scenegen::GenerateOptions& options,
                                                        std::span<const std::string> set);

/// Generates one scene by name, or all, and prints a line per file to standard output.
[[nodiscard]] physics::Result<void> generate_scenes(const std::string& scene,
                                                    const std::filesystem::path& directory,
                                                    std::span<const std::string> set);

}  // namespace emit::tool
